"""Derivatives by dimensions of pads, against differences on morphed meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diffuse_scene import by, derivatives, pad_scene

from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.results.largest_strain import LargestStrain
from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches
from mitsuba_taxel.pads import mesh_velocity
from mitsuba_taxel.parameters import parameters_of
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse.deterministic_light import COARSE, FINE
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.transport.cell import Mesh
from mitsuba_taxel.transport.patches import LATTICE


@pytest.fixture(scope="module")
def found():
    return derivatives(pad_scene(), "cell_size", "height", "wall", "cell_height")


def strain_rate(derivatives, name):
    return derivatives.strain_rates[derivatives.parameters.index(name)]


def reading_and_strain(cells, amounts, degree):
    """Of the one cell in equilibrium, with parameters changed by some amounts: its mesh is morphed by dimensions."""
    state, pad, patches = cells.pad.state, cells.pad.pad, cells.patches(0).faces
    forces, constants = (
        {name: by for name, by in amounts.items() if name in names}
        for names in (COMPONENTS, parameters_of(type(state.material)))
    )
    dimensions = {name: by for name, by in amounts.items() if name not in forces | constants}
    value = tuple(np.add(state.value, [forces.get(name, 0.0) for name in COMPONENTS]))
    material = state.material.changed(**{name: getattr(state.material, name) + by for name, by in constants.items()})
    mesh, moved = state.mesh, patches.walls
    if dimensions:
        mesh, moved = (
            replace(each, points=each.points + sum(by * mesh_velocity(pad, each, n) for n, by in dimensions.items()))
            for each in (mesh, moved)
        )
        changed = pad.changed(**{name: pad.dimensions[name] + by for name, by in dimensions.items()})
        patches = WallPatches(mesh, moved, changed, cells.cells[0].faces, 1, LATTICE)
    loaded = LoadedPad(mesh, material, state.load)
    solution, _ = loaded.solve(loaded.gather(state.displacement, state.pressure), value)
    displacement, _ = loaded.split(solution.unknowns)
    light = Mesh(patches.rest, degree) if dimensions else cells.light_mesh(0, degree)
    read = cells.solved(0, light, patches.rest + patches.carried(displacement)).reading
    strain = LargestStrain(replace(state, mesh=mesh, displacement=displacement)).value
    return np.array([cells.taxels[0].power * read, strain])


def difference_on_morphed_meshes(cells, amounts, step=2e-3, degree=FINE):
    """Of the reading and the largest strain, along a change of parameters by some amounts."""
    ahead, behind = (
        reading_and_strain(cells, {name: sign * step * by for name, by in amounts.items()}, degree) for sign in (1, -1)
    )
    return (ahead - behind) / (2 * step)


COMPONENTS = "fx", "fy", "fz"
SOME, OTHERS = ("fx", "fz", "youngs_modulus", "cell_size", "wall"), ("fy", "poisson_ratio", "height", "cell_height")
SHAPES = [
    *((cell, "isotropic", (0.05, 0.02, -0.8), SOME) for cell in ("parallelepiped", "spherical")),
    ("cylindrical", "lambertian", (0.0, -0.1, -0.6), OTHERS),
    ("hemispheric", "lambertian", (-0.1, 0.05, -0.4), ("wall", "fx", "fz", *OTHERS)),
    ("parallelepiped", "isotropic", (0.0, 0.0, -0.6), ("fz", *OTHERS[1:])),
]


@pytest.mark.parametrize(("cell", "scattering", "force", "names"), SHAPES)
def test_all_shapes_walls_and_loads_have_the_derivatives_of_equilibria(cell, scattering, force, names):
    """Within 0.5 %, or what is 0.2 % of the largest by parameters of the same unit; of the coarser solution."""
    scene = pad_scene({"scattering": scattering}, cell=cell, mesh_size=2.2, force=list(force))
    live = scene.load()
    found, cells = (
        derivatives_by([rates(scene, name) for name in names], live, False, degree=COARSE),
        DiffuseCells(live),
    )
    steps = {"youngs_modulus": 0.01, "poisson_ratio": 1e-4}
    expected = np.array(
        [difference_on_morphed_meshes(cells, {name: 1.0}, steps.get(name, 2e-3), COARSE)[0] for name in names]
    )
    units = np.array(found.units)
    largest = np.array([np.abs(expected[units == unit]).max() for unit in units])
    assert np.all(np.abs(found.values[0] - expected) < 5e-3 * np.abs(expected) + 2e-3 * largest)


@pytest.mark.parametrize("name", ["cell_size", "height", "wall", "cell_height"])
def test_derivatives_by_dimensions_are_differences_on_morphed_meshes(name, found):
    expected = difference_on_morphed_meshes(DiffuseCells(pad_scene().load()), {name: 1.0})
    assert [by(found, name)[0], strain_rate(found, name)] == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize(("cell", "degree"), [("hemispheric", COARSE), ("parallelepiped", FINE)])
def test_derivatives_of_leaning_cells_are_differences_on_morphed_meshes(cell, degree):
    """By how far they lean, and by others, of which one changes their slope; the step is so small because of the
    strain, whose most strained elements change with it."""
    scene = pad_scene(cell=cell, top_x=0.25, top_y=-0.1)
    found = derivatives(scene, "top_x", "top_y", "cell_height", "cell_size", degree=degree)
    cells = DiffuseCells(scene.load())
    for amounts in ({"top_x": 1.0, "top_y": 0.4}, {"cell_height": 1.0}, {"cell_size": 1.0}):
        expected = difference_on_morphed_meshes(cells, amounts, step=3e-4, degree=degree)
        columns = [found.parameters.index(name) for name in amounts]
        rates = np.column_stack([found.values[0], found.strain_rates])[columns]
        assert [*amounts.values()] @ rates == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("section", ["round", "square"])
def test_derivatives_by_points_of_a_profile_are_differences_on_morphed_meshes(section):
    """Of all of them at once, in different amounts; of the coarser solution."""
    points = "0.95 0.4; 0.6 0.75; 0.3 0.85; 0 0.9"  # of which the square section has few patches
    scene = pad_scene(cell="profile", profile=points, section=section, wall={"scattering": "lambertian"})
    names = ["profile_r1", "profile_z1", "profile_r2", "profile_z2", "profile_r3", "profile_z3", "profile_z4"]
    amounts = dict(zip(names, (0.5, -0.1, 0.6, 1.0, 1.1, -0.7, 0.9), strict=True))
    found = derivatives(scene, *names, degree=COARSE)
    expected = difference_on_morphed_meshes(DiffuseCells(scene.load()), amounts, degree=COARSE)
    assert [*amounts.values()] @ np.column_stack([found.values[0], found.strain_rates]) == pytest.approx(
        expected, rel=3e-3
    )
