"""The least distance between cells and packages: of cuboids in closed form, and its derivatives against differences."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from one_cell import one_cell
from trimesh.creation import box

from mitsuba_taxel import Pad, Scene
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.surfaces.triangles import closest_on_triangles
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad
from mitsuba_taxel.sensing.derivatives.package_clearance import WALLS, PackageClearance, clearances
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.scene.clearance import packages
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

pytestmark = pytest.mark.usefixtures("llvm_mono")
NUMBERS = {"cell_size": 2.6, "cell_height": 1.6, "youngs_modulus": 4.0, "x": 0.05, "fz": 0.0}
LENGTH, HEIGHT = 1.46, 0.5
"""Of the package, along x and z."""


@pytest.fixture
def scene(tmp_path):
    text = one_cell(**NUMBERS).replace("<vector", "".join(map(_as_given, ("cell_size", "cell_height"))) + "<vector", 1)
    place = '<shape type="photo_reflector"> <transform name="to_world"><translate x="$x"/></transform>'
    (tmp_path / "cell.xml").write_text(text.replace('<shape type="photo_reflector">', place))

    def at(**given):
        origin = (
            {"meshed_as": f"cell_size={NUMBERS['cell_size']}"} if "cell_size" in given or "cell_height" in given else {}
        )
        return Scene(tmp_path / "cell.xml", {name: str(value) for name, value in given.items()} | origin)

    return at


def _as_given(name):
    return f'<float name="{name}" value="${name}"/> '


def clearance(scene):
    live = scene.load()
    return PackageClearance(deformed_pads(live)[0].state, packages(live)).value


@pytest.mark.parametrize(
    ("size", "height", "expected"), [(2.6, 1.6, (2.6 - LENGTH) / 2 - 0.05), (2.6, 0.9, 0.9 - HEIGHT)]
)
def test_a_cuboid_at_rest(scene, size, height, expected):
    """The nearest walls are those at the ends of the package, which lies 0.05 off the axis, or the roof."""
    assert clearance(scene(cell_size=size, cell_height=height)) == pytest.approx(expected, abs=1e-6)


STEPS = {"fz": 0.01, "youngs_modulus": 0.01, "cell_size": 0.002, "cell_height": 0.002, "x": 0.002}


@pytest.mark.parametrize(
    ("height", "names"),
    [(1.6, ("fz", "youngs_modulus", "cell_size", "x")), (0.9, tuple(STEPS))],
    ids=["side", "roof"],
)
def test_derivatives_are_differences_of_the_whole_chain(scene, height, names):
    """Under load, on one mesh."""
    loaded = {"fz": -0.8, "cell_height": height, "cell_size": 2.6, "youngs_modulus": 4.0, "x": 0.05}
    own = scene(**loaded)
    live, changes = own.load(), [rates(own, name) for name in names]
    (pad,) = deformed_pads(live)
    linear = LinearisedPad(pad, pad.state)
    value, found = clearances(
        pad.state, [linear.nodal(each) for each in changes], live, [each.scenes() for each in changes]
    )
    assert value < clearance(scene(**{**loaded, "fz": 0.0})) - 1e-4
    for name, rate in zip(names, found, strict=True):
        ends = (clearance(scene(**{**loaded, name: loaded[name] + sign * STEPS[name]})) for sign in (1, -1))
        difference = np.subtract(*ends) / (2 * STEPS[name])
        assert rate == pytest.approx(difference, rel=5e-3, abs=1e-5), name


@pytest.mark.parametrize("rough", [0.0, 0.05])
def test_the_nearest_of_all_packages_is_found(rough):
    """Of three boxes of two bodies, beside flat or rough walls: as among all pairs of a place and a triangle."""
    mesh = Pad(rows=1, columns=2).mesh(2.5)
    faces = mesh.faces[np.isin(mesh.face_region, WALLS)]
    moved = np.zeros_like(mesh.points)
    moved[np.unique(faces)] = np.random.default_rng(1).normal(0, rough, (len(np.unique(faces)), 3))
    one, other = (box((1.46, 1.06, 0.5)).triangles + (x, 0.01, 0.25) for x in (-1.775, 1.775))
    bodies = [np.concatenate([one, other]), other + (0, 0, 0.2)]
    sixths = np.array([[6 - i - j, i, j] for i in range(7) for j in range(7 - i)]) / 6
    places = (shape_functions(sixths) @ (mesh.points + moved)[faces]).reshape(-1, 3)
    feet = [closest_on_triangles(places, np.broadcast_to(c, (len(places), 3, 3))) for body in bodies for c in body]
    least = np.linalg.norm(np.array(feet) - places, axis=2).min()
    assert PackageClearance(SimpleNamespace(mesh=mesh, displacement=moved), bodies).value == pytest.approx(least)
