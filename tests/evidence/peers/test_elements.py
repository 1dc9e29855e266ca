"""The mechanics' peer: our element of its kind against closed forms, its input and output, and that both agree."""

from __future__ import annotations

import csv
import shutil
from functools import lru_cache

import numpy as np
import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench_peers import peers

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.peers.elements import table
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.pads import REGIONS, Pad, mesh_pad

TOTAL = """
 total force (fx,fy,fz) for set BALL and time  0.1000000E+01

       -1.389803E-02 -7.737624E-03 -1.156888E+00
"""
needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")


@pytest.fixture(scope="module")
def meshes():
    """A function that meshes pads, each once."""
    return lru_cache(lambda cell, rows=1, columns=1, size=1.6: mesh_pad(Pad(cell, rows, columns), size))


def _nodes(mesh, *regions):
    return np.unique(mesh.faces[np.isin(mesh.face_region, [REGIONS[name] for name in regions])])


def test_nodal_forces_do_the_work_of_a_uniform_load(meshes):
    from mitsuba_taxel.evidence.peers.displacement_form import nodal_forces

    mesh = meshes("hemispheric")
    x, y, _ = mesh.points.T
    width, depth, _ = np.ptp(mesh.points, axis=0)
    force = np.array([0.3, -0.2, -20])
    load = nodal_forces(mesh, force)
    mean_of = {1: np.ones_like(x), width**2 / 12: x**2, depth**2 / 12: y**2}
    for mean, field in mean_of.items():
        assert field @ load == pytest.approx(mean * force, rel=1e-12)


@pytest.mark.parametrize("poisson_ratio", [0.3, 0.49, 0.4999])
@pytest.mark.parametrize("stretch", [(1.05, 0.9, 0.8), (0.97, 1.1, 1.2)])
def test_forces_of_a_homogeneous_stretch_are_those_of_the_closed_form(meshes, poisson_ratio, stretch):
    from mitsuba_taxel.evidence.peers.displacement_form import DisplacementForm, held, nodal_forces

    mesh, material = meshes("parallelepiped"), NeoHookean(poisson_ratio=poisson_ratio)
    forces = np.zeros(mesh.points.shape)
    free = ~held(mesh)
    forces[free] = DisplacementForm(mesh, material).linearised(mesh.points * (np.array(stretch) - 1))[0].reshape(-1, 3)

    squares, volume = np.square(stretch), np.prod(stretch)
    mu, kappa = 4.16 / (2 + 2 * poisson_ratio), 4.16 / (3 - 6 * poisson_ratio)
    cauchy = mu * volume ** (-5 / 3) * (squares[2] - squares.sum() / 3) + kappa * (volume - 1)
    width, depth, _ = np.ptp(mesh.points, axis=0)
    expected = nodal_forces(mesh, (0, 0, cauchy * volume / stretch[2] * width * depth))

    inside = np.setdiff1d(np.flatnonzero(free), np.unique(mesh.faces))
    top = np.setdiff1d(_nodes(mesh, "top"), _nodes(mesh, "outer"))
    scale = np.abs(expected).max()
    assert len(inside) and len(top)
    np.testing.assert_allclose(forces[inside], 0, atol=1e-11 * scale)
    np.testing.assert_allclose(forces[top], expected[top], atol=1e-11 * scale)


@pytest.mark.parametrize("poisson_ratio", [0.3, 0.49])
def test_tangent_is_the_derivative_of_the_forces(meshes, poisson_ratio):
    from mitsuba_taxel.evidence.peers.displacement_form import DisplacementForm, held

    mesh, rng = meshes("hemispheric"), np.random.default_rng(1)
    element, free = DisplacementForm(mesh, NeoHookean(poisson_ratio=poisson_ratio)), ~held(mesh)
    state, direction = (scale * rng.standard_normal(mesh.points.shape) for scale in (0.002, 1.0))
    direction[~free] = 0
    _, lower = element.linearised(state)
    diagonal = lower.diagonal()
    product = lower @ direction[free].ravel() + lower.T @ direction[free].ravel() - diagonal * direction[free].ravel()
    step = 1e-6
    ahead, behind = (element.linearised(state + sign * step * direction)[0] for sign in (1, -1))
    np.testing.assert_allclose((ahead - behind) / (2 * step), product, atol=1e-7 * np.abs(product).max())


def test_load_beyond_reach_is_an_error(meshes):
    from mitsuba_taxel.evidence.peers.displacement_form import solve

    with pytest.raises(ComputationError):
        solve(meshes("parallelepiped", size=4.0), NeoHookean(), (0, 0, 400))


def test_incompressible_material_is_refused(meshes):
    from mitsuba_taxel.evidence.peers.calculix import deck
    from mitsuba_taxel.evidence.peers.displacement_form import solve

    for use in (solve, deck):
        with pytest.raises(InputError, match=r"poisson_ratio = 0\.5 .* below 0\.5 is needed\.$"):
            use(meshes("parallelepiped"), NeoHookean(poisson_ratio=0.5), (0, 0, -1))


def test_deck_holds_mesh_load_and_moduli(meshes):
    from mitsuba_taxel.evidence.peers.calculix import deck
    from mitsuba_taxel.evidence.peers.displacement_form import held

    mesh, material = meshes("cylindrical"), NeoHookean(youngs_modulus=2.0, poisson_ratio=0.4)
    blocks = {}
    for line in deck(mesh, material, (1, 0, -5)).splitlines():
        if line.startswith("*"):
            rows = blocks.setdefault(line.split(",")[0], [])
        else:
            assert all(len(word) <= 20 for word in line.split(","))  # the program reads no more
            rows.append(line.split(","))
    nodes = np.array(blocks["*NODE"], dtype=float)
    np.testing.assert_allclose(nodes[:, 1:], mesh.points, rtol=1e-13, atol=0)
    assert np.array_equal(nodes[:, 0], 1 + np.arange(len(mesh.points)))
    assert np.array_equal(np.array(blocks["*ELEMENT"], dtype=int)[:, 1:], mesh.tets + 1)
    assert len(blocks["*BOUNDARY"]) == np.count_nonzero(held(mesh))
    axis, share = np.array(blocks["*CLOAD"], dtype=float)[:, 1:].T
    assert [share[axis == k].sum() for k in (1, 2, 3)] == pytest.approx([1, 0, -5], abs=1e-12)
    mu, kappa = 2 / 2.8, 2 / 0.6
    assert [float(word) for word in blocks["*HYPERELASTIC"][0]] == pytest.approx([mu / 2, 2 / kappa], rel=1e-12)


def test_displacements_and_force_are_read(tmp_path):
    from mitsuba_taxel.evidence.peers.calculix import read_displacement, read_force

    file = tmp_path / "pad.dat"
    file.write_text(
        "\n displacements (vx,vy,vz) for set ALL and time  0.1000000E+01\n\n"
        "         1  0.000000E+00 -7.407240E-17  3.757569E-02\n"
        "         2  5.914691E-02  1.896835E-17 -5.971062E-02\n"
    )
    expected = [[0, -7.40724e-17, 0.03757569], [0.05914691, 1.896835e-17, -0.05971062]]
    assert np.array_equal(read_displacement(file, 2), expected)
    assert np.isnan(read_force(file)).all()
    file.write_text(file.read_text() + TOTAL)
    assert np.array_equal(read_displacement(file, 2), expected)
    assert np.array_equal(read_force(file), [-0.01389803, -7.737624e-03, -1.156888])
    step = "\n                        S T E P       1\n\n\n                                INCREMENT     1\n\n"
    file.write_text(step + file.read_text())  # as version 2.23 begins the file
    assert np.array_equal(read_displacement(file, 2), expected)
    assert np.array_equal(read_force(file), [-0.01389803, -7.737624e-03, -1.156888])


@pytest.mark.parametrize("cell, tolerance", [("parallelepiped", 1e-12), ("cylindrical", 1e-3)])
@pytest.mark.parametrize("number", [1, 5, 6])
def test_mean_over_flat_roofs(meshes, cell, tolerance, number):
    from mitsuba_taxel.evidence.peers.elements import mean_roof_displacement

    pad = Pad(cell, rows=2, columns=3)
    mesh = meshes(cell, rows=2, columns=3)
    x, y, _ = mesh.points.T
    displacement = np.stack([x, y, x**2 + 0.5 * x * y - y], axis=1)
    cx, cy = pad.cell_centres[number - 1]
    spread = pad.cell_size**2 / (12 if cell == "parallelepiped" else 16)
    expected = cx**2 + spread + 0.5 * cx * cy - cy
    assert mean_roof_displacement(mesh, displacement, number) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("cell", ["spherical", "hemispheric"])
def test_mean_over_domes_is_by_their_area(meshes, cell):
    """The area of a sphere between two heights is proportional to their distance (Archimedes)."""
    from mitsuba_taxel.evidence.peers.elements import mean_roof_displacement

    mesh, pad = meshes(cell), Pad(cell, rows=1, columns=1)
    expected = 0.5 * (pad.top_of_cell + pad.side_height)
    assert mean_roof_displacement(mesh, mesh.points, 1) == pytest.approx(expected, rel=1e-3)


def test_missing_program_is_said_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ComputationError, match=r"^ccx \(CalculiX\) is not installed: "):
        next(table([3.0], [0.49]))


@needs_ccx
@pytest.mark.parametrize(
    ("cell", "poisson_ratio", "force"),
    [("parallelepiped", 0.3, (0.4, -0.2, -1)), ("hemispheric", 0.49, (0, 0, -3))],
)
def test_nodes_agree_with_the_peer(meshes, cell, poisson_ratio, force):
    from mitsuba_taxel.evidence.peers import calculix, displacement_form

    mesh, material = meshes(cell), NeoHookean(poisson_ratio=poisson_ratio)
    result = calculix.solve(mesh, material, force)
    expected = displacement_form.solve(mesh, material, force)
    assert np.abs(expected).max() > 0.03
    assert np.abs(result.displacement - expected).max() < 1e-6
    assert result.iterations >= result.increments >= 1 and result.seconds > 0


@needs_ccx
def test_peer_that_gives_up_is_an_error(meshes):
    from mitsuba_taxel.evidence.peers import calculix

    with pytest.raises(ComputationError, match=r"^ccx stopped: increment size smaller than minimum"):
        calculix.solve(meshes("parallelepiped", size=4.0), NeoHookean(), (0, 0, -60))


@needs_ccx
def test_command_writes_its_table(tmp_path):
    file = tmp_path / "table.csv"
    arguments = ["elements", "--mesh-size", "4", "--poisson-ratio", "0.49", "--csv", str(file)]
    assert CliRunner().invoke(peers, arguments, catch_exceptions=False).exit_code == 0
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["threads"] for row in rows] == ["1", "2"]
    for row in rows:
        assert float(row["difference mm"]) < 1e-6 and float(row["roof mm"]) < -0.05 and float(row["seconds"]) > 0
