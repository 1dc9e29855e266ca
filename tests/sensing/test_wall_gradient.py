"""Changes of readings by displacements of the nodes: against derivatives by a load, and differences of readings."""

from __future__ import annotations

import numpy as np
import pytest
from diffuse_scene import by, derivatives, pad_scene

from mitsuba_taxel.mechanics import PatchForce, linearise, load_path
from mitsuba_taxel.sensing.derivatives.wall_gradient import WallGradient
from mitsuba_taxel.sensing.diffuse import diffuse_cells
from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells, NotFollowed


@pytest.mark.parametrize("cell", ["hemispheric", "parallelepiped"])
def test_along_a_load_it_is_the_derivative_by_the_load(cell):
    scene = pad_scene(cell=cell)
    cells = DiffuseCells(scene.load())
    light = WallGradient(cells, cells.pad.state)
    light.refuse_occluded()
    np.testing.assert_allclose(light.power, deterministic_light(cells.scene, False).power, rtol=1e-9)
    linear = linearise(cells.pad.state)
    for name, unit in {"fx": (1, 0, 0), "fz": (0, 0, 1)}.items():
        expected = by(derivatives(scene, name), name)[0]
        assert light.along(linear.by_value(unit))[0] == pytest.approx(expected, rel=1e-6, abs=1e-9 * light.power[0])


@pytest.mark.parametrize(("cell", "place"), [("hemispheric", (0.5, 0.3)), ("parallelepiped", (0.9, -0.4))])
def test_at_rest_it_is_the_difference_of_readings(cell, place):
    """A flat roof bends inwards under the patch: light between its points begins with the load."""
    scene = pad_scene(cell=cell, force=[0, 0, 0])
    cells = DiffuseCells(scene.load())
    pad, load, force = cells.pad, PatchForce(place, (0.8, 0.8)), 0.1
    values = [(0, 0, 0), (0, 0, -force), (0, 0, -2 * force)]
    rest, *pushed = load_path(pad.pad, pad.material, values, load=load, mesh_size=1.7, step_tolerance=1e-6)
    light = WallGradient(cells, rest)
    once, twice = (WallGradient(cells, state).power - light.power for state in pushed)
    expected = light.along(linearise(rest).by_value((0, 0, -1)))
    assert (4 * once - twice) / (2 * force) == pytest.approx(expected, rel=0.005)  # to zero force, Richardson


def test_light_that_is_not_resolved_is_refused(monkeypatch):
    cells = DiffuseCells(pad_scene(force=[0, 0, 0]).load())
    light = WallGradient(cells, cells.pad.state)
    monkeypatch.setattr(diffuse_cells.DiffuseCells, "occluded_fraction", lambda *arguments: 0.2)
    with pytest.raises(NotFollowed, match="occlude 20.0%"):
        light.refuse_occluded()
    monkeypatch.setattr("mitsuba_taxel.sensing.derivatives.wall_gradient.MOST_OFF", 0.0)
    with pytest.raises(NotFollowed, match="too coarse for a narrow beam"):
        WallGradient(cells, cells.pad.state)
