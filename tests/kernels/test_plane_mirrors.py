"""Connections over plane mirrors: against hits, which know of no image, and as they are meant to pay.

Z-tests at 4 standard errors: of the 6 comparisons of this file, one fails by chance in 2600 runs.
"""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.kernels.paths.plane_mirrors import plane_mirrors
from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.taxels import taxels_of

pytestmark = pytest.mark.usefixtures("llvm_mono")
MIRROR = {"type": "wall", "scattering": "mirror", "reflectance": 0.9}
MIXED = {"type": "wall", "scattering": "mixed", "reflectance": 0.9, "specular": 0.5, "lambertian": 0.5}
SIDES = {"type": "wall", "scattering": "lambertian", "reflectance": 0.9}


def cells(roof=MIRROR, cell="parallelepiped", columns=1, strategy="all", detector=None, part=None, sides=SIDES, **pad):
    walls = {"type": "region", "roof": roof, "side": sides}
    reflector = {"type": "photo_reflector", "columns": columns, "rows": 1}
    if part is None:
        reflector |= {"spacing": 0.9, "led": {"type": "annular_led"}}
        reflector["detector"] = {"type": "phototransistor", **(detector or {})}
    else:
        reflector["part"] = part
        pad |= {"cell_size": 6.0, "pitch": 8.0, "height": 6.0, "cell_height": 3.5}
    return Scene(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer", "strategy": strategy},
            "pad": {"type": "deformable_pad", "cell": cell, "rows": 1, "columns": columns, "walls": walls, **pad},
            "packages": reflector,
        }
    )


def mirrors_of(scene):
    live = scene.load()
    return plane_mirrors(live, taxels_of(live)[0])


def test_unloaded_flat_roofs_are_plane():
    mirrors = mirrors_of(cells(columns=2))
    planes = np.array(mirrors.planes).reshape(-1, 4)
    assert np.abs(planes[:, 2]) == pytest.approx(1) and np.abs(planes[:, 3]) == pytest.approx(1.55)
    assert set(np.array(mirrors.owner)) == {-1, 0, 1}
    assert mirrors_of(cells(cell="cylindrical")) is not None


@pytest.mark.parametrize(
    "scene",
    [
        cells(force=[0, 0, -0.1]),
        cells(cell="spherical"),
        cells(SIDES),
        cells({"type": "wall", "scattering": "rough_mirror", "rms_slope": 2.0}),
        cells(sides={"type": "wall", "scattering": "absorbing"}),
    ],
    ids=["bent", "curved", "diffuse", "rough", "nothing scatters"],
)
def test_other_cells_have_no_image(scene):
    assert mirrors_of(scene) is None


@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"roof": MIXED},
        {"detector": {"depth": 0.9}},  # which more hits find
        {"part": "VCNT2020"},  # below a window of resin
    ],
    ids=["mirror", "mixed", "large", "window"],
)
def test_hits_alone_read_the_same(parts):
    agree(parts, 1 << 14, 0.035)


def test_each_cell_has_its_own_mirror():
    agree({"columns": 2, "cell": "cylindrical"}, 1 << 12, 0.04)


def agree(parts, points, largest_error):
    both = measure(cells(**parts), points=1 << 11, seed=1)
    hits = measure(cells(**parts, strategy="unidirectional_hits"), points=points, seed=2)
    error = np.hypot(both.standard_error, hits.standard_error)
    assert np.all(error < largest_error * hits.power)
    assert np.all(np.abs(both.power - hits.power) < 4 * error)


@pytest.mark.parametrize(("name", "bends"), [("fz", True), ("spacing", False)])
def test_ends_of_a_difference_use_images_alike(name, bends, monkeypatch):
    """A pad that is pressed at one end and at rest at the other has an image at neither; other changes keep theirs."""
    used, scene = [], cells({**MIXED, "lambertian": 0.25, "isotropic": 0.25})

    def spied(*arguments):
        used.append(plane_mirrors(*arguments) is not None)
        return plane_mirrors(*arguments)

    monkeypatch.setattr("mitsuba_taxel.plugins.integrators.taxel_tracer.plane_mirrors", spied)
    ready = prepare(scene)
    derivatives_of_paths([rates(scene, name)], ready, np.ones((32, 1)), 1, 16, fixed=True)
    assert used and set(used) == {not bends}
    assert plane_mirrors(ready.scene, taxels_of(ready.scene)[0]) is not None


def test_few_paths_suffice():
    """By hits alone, and connections without images, 1024 points give 2 %."""
    assert measure(cells(), points=1 << 10).relative_error < 0.006
