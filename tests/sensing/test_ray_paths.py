"""Sampled light paths: where they start, turn and end, and how many arrive."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.sensing import sample_paths
from mitsuba_taxel.sensing.validity.ray_paths import MOST_VERTICES


def plate(height=1.0, columns=1, **wall):
    """Photo-reflectors under a plate of 8 x 8 mm, ``height`` above the LEDs."""
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate([0, 0, 0.5 + height]).rotate([1, 0, 0], 180).scale(4)
    parts = {"emitter": {"type": "annular_led"}, "sensor": {"type": "phototransistor"}}
    return Scene(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer"},
            "pr": {"type": "photo_reflector", "columns": columns, **parts},
            "plate": {"type": "rectangle", "to_world": place, "bsdf": {"type": "wall", **wall}},
        }
    )


def test_paths_by_a_mirror(llvm_mono):
    """From the LED to the plate and, at the same angle, to the phototransistor."""
    paths = sample_paths(plate(scattering="mirror").load(), 1, count=60)
    assert len(paths.vertices) == 60 and paths.reached.sum() == 30
    for path in np.array([path for path, reached in zip(paths.vertices, paths.reached, strict=True) if reached]):
        source, turn, end = path
        assert np.abs(source[:2] - (-0.45, 0)).max() <= 0.125 + 1e-6 and source[2] == 0.5
        assert turn[2] == pytest.approx(1.5, abs=1e-5) and end[2] == pytest.approx(0.5, abs=1e-5)
        assert np.all(np.abs(end[:2] - (0.45, 0)) <= (0.26 + 1e-6, 0.15 + 1e-6))
        assert (end - turn) * (1, 1, -1) == pytest.approx(turn - source, abs=1e-4)


def test_paths_that_escape_end_in_a_stub(llvm_mono):
    paths = sample_paths(plate(scattering="lambertian").load(), 1, count=100)
    ends = [path for path in paths.vertices if abs(path[-1, 2] - 0.5) > 1e-5 and abs(path[-1, 2] - 1.5) > 1e-5]
    assert len(ends) > 20
    for path in ends:
        assert np.linalg.norm(path[-1] - path[-2]) == pytest.approx(0.9, rel=1e-3)


@pytest.mark.parametrize("reflectance", [1.0, 0.4])
def test_as_many_arrive_as_the_reading_says(llvm_mono, agree, reflectance):
    """The share that arrives is that of a binomial distribution with the reading as its probability."""
    scene = plate(scattering="isotropic", reflectance=reflectance)
    paths = sample_paths(scene.load(), 1, count=2000)
    share = paths.arrived / paths.drawn
    readings = measure(scene, points=4096)
    agree(share, np.sqrt(share / paths.drawn), readings.power, readings.standard_error, replicates=1000)
    assert np.all(paths.power == 1 / paths.drawn)


def test_each_taxel_has_its_own(llvm_mono):
    live = plate(columns=2).load()
    for taxel, x in ((1, -1.775), (2, 1.775)):
        paths = sample_paths(live, taxel, count=20)
        assert all(abs(path[0, 0] - (x - 0.45)) < 0.13 for path in paths.vertices)
        assert all(abs(path[-1, 0] - (x + 0.45)) < 0.27 for path in paths.vertices[:10])


def test_endless_paths_are_cut(llvm_mono):
    """Between two mirrors, wide and close together, light goes on and on."""
    import mitsuba as mi

    scene = plate(0.03, scattering="mirror")
    for name, x, z in (("plate", 0, 0.53), ("below", 40.2, 0.51)):
        place = mi.ScalarTransform4f().translate([x, 0, z]).scale(40)
        mirror = {"type": "wall", "scattering": "mirror"}
        scene.source[name] = {"type": "rectangle", "to_world": place, "bsdf": mirror}
    paths = sample_paths(scene.load(), 1, count=200)
    lengths = [len(path) for path in paths.vertices]
    assert max(lengths) == MOST_VERTICES and min(lengths) >= 2
    assert all(np.isfinite(path).all() for path in paths.vertices)


def test_where_none_arrives_others_take_their_place(llvm_mono):
    seen = []
    scene = plate(scattering="absorbing").load()
    paths = sample_paths(scene, 1, count=10, progress=lambda done, total: seen.append((done, total)))
    assert len(paths.vertices) == 10 and not paths.reached.any() and paths.arrived == 0
    assert set(seen) == {(0, 5)}


def test_seed(llvm_mono):
    live = plate().load()
    first, again, other = (sample_paths(live, 1, count=10, seed=seed).vertices for seed in (1, 1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not any(np.array_equal(a[0], b[0]) for a, b in zip(first, other, strict=True))


@pytest.mark.parametrize("taxel, request_, culprit", [(0, {}, "taxel"), (2, {}, "taxel"), (1, {"count": 0}, "count")])
def test_bad_requests(llvm_mono, taxel, request_, culprit):
    with pytest.raises(InputError, match=f"^{culprit} = "):
        sample_paths(plate().load(), taxel, **request_)
