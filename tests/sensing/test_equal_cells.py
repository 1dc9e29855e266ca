"""Cells that a mirror makes equal are told from those that only look alike."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import Scene
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X
from mitsuba_taxel.sensing.derivatives import diffuse_derivatives as derivatives
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse.deterministic_light import FINE
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.sensing.diffuse.equal_cells import _near_images, equal_at_rest, equal_cells


def pair(rows, columns, force):
    """Cells in a row; LED and phototransistor lie beside each other along x."""
    package = {"type": "photo_reflector", "rows": rows, "columns": columns, "spacing": 0.9}
    pad = {"type": "deformable_pad", "cell": "cylindrical", "rows": rows, "columns": columns, "mesh_size": 1.7}
    ends = {"led": {"type": "annular_led"}, "detector": {"type": "phototransistor"}}
    wall = {"type": "region", "roof": {"type": "wall", "scattering": "isotropic"}}
    return Scene({"type": "scene", "pad": {**pad, "force": force, "bsdf": wall}, "package": {**package, **ends}})


@pytest.mark.parametrize(
    ("rows", "columns", "force", "first"),
    [(2, 1, [0.05, 0, -0.8], [0, 0]), (2, 1, [0, 0.05, -0.8], [0, 1]), (1, 2, [0, 0, -0.8], [0, 1])],
)
def test_cells_are_equal_where_pad_load_and_ends_are(rows, columns, force, first):
    cells = DiffuseCells(pair(rows, columns, force).load())
    state = cells.pad.state
    assert equal_cells(cells, state, [state.displacement], list(state.deviations)) == first


@pytest.mark.parametrize("reflectance", [0.0, 0.7])
def test_cells_at_rest_are_equal_wherever_they_are(reflectance):
    """So are the pairs of points between their walls, and packages, which are found once."""
    scene = pair(2, 3, [0, 0, 0]).source
    scene["package"]["bsdf"] = {"type": "wall", "reflectance": reflectance}
    cells = DiffuseCells(Scene(scene).load())
    assert equal_at_rest(cells) == 6 * [0]
    meshes = [cells.light_mesh(k, FINE) for k in range(6)]
    assert all(mesh is meshes[0] for mesh in meshes)
    alone = [cells.solved(k, meshes[k], cells.patches(k).rest).reading for k in range(6)]
    assert np.ptp(alone) < 1e-6 * alone[0]  # places of LEDs are in single precision


@pytest.mark.parametrize(("changed", "first"), [({"spacing": 0.9}, [0, 0]), ({"pitch": 3.6}, [0, 1])])
def test_cells_at_rest_whose_taxels_are_elsewhere_in_them_are_not(changed, first):
    scene = pair(1, 2, [0, 0, 0]).source
    scene["package"].update(changed)
    assert equal_at_rest(DiffuseCells(Scene(scene).load())) == first


@pytest.mark.parametrize("force", [[0, 0, 0], [0, 0, -0.8]])
@pytest.mark.parametrize("equal", [True, False])
def test_cells_are_not_equal_whose_packages_scatter_differently(llvm_mono, force, equal):
    """Two packages on a mirror plane of the pad, each with its own wall."""
    scene = pair(2, 1, force).source
    package = scene.pop("package") | {"rows": 1}
    for name, y, reflectance in (("near", 1.775, 0.5), ("far", -1.775, 0.5 if equal else 0.6)):
        place = llvm_mono.ScalarTransform4f().translate([0, y, 0])
        scene[name] = package | {"to_world": place, "bsdf": {"type": "wall", "reflectance": reflectance}}
    cells = DiffuseCells(Scene(scene).load())
    found = equal_cells(cells, cells.pad.state, [cells.pad.state.displacement]) if any(force) else equal_at_rest(cells)
    assert found == ([0, 0] if equal else [0, 1])


def test_only_cells_at_mirror_images_are_compared():
    """Of a grid of points that a diagonal maps to itself, each has one image; others are not candidates."""
    side = np.linspace(-3, 3, 7)
    points = np.stack([*np.meshgrid(side, side, indexing="ij"), np.full((7, 7), 0.5)], axis=-1).reshape(-1, 3)
    order = np.random.default_rng(0).permutation(len(points))
    for mirror, image in ((ACROSS_X, lambda x, y: (-x, y)), (ACROSS_DIAGONAL, lambda x, y: (y, x))):
        found = _near_images(mirror, list(points[order] * (1 + 3e-8)))
        for (x, y, _), candidates in zip(points[order], found, strict=True):
            (number,) = candidates
            assert tuple(points[order[number], :2]) == pytest.approx(image(x, y), abs=1e-12)


def test_equal_cells_have_the_derivatives_that_each_has_alone(monkeypatch):
    scene = pair(2, 1, [0.05, 0, -0.8])

    def found():
        return derivatives.derivatives_by([rates(scene, name) for name in ("fz", "fx", "youngs_modulus")], scene.load())

    copied = found()
    monkeypatch.setattr(derivatives, "equal_cells", lambda cells, state, fields: list(range(len(cells.taxels))))
    alone = found()
    assert np.array_equal(copied.values[0], copied.values[1])
    assert np.all(abs(copied.values - alone.values) < 0.1 * alone.standard_errors)
