"""Stability against displacements that lack a state's symmetry: where pieces of a pad tell it, that costs little."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
import scipy.sparse as sparse

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import NeoHookean, PlateDisplacement, PlateForce, Pressure, SpreadForce, load_path
from mitsuba_taxel.mechanics.continuation import path_problem
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.continuation.path_segments import LONGER_PRESSED
from mitsuba_taxel.mechanics.elements import solvers
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between
from mitsuba_taxel.mechanics.equilibrium import stability
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import natural_step
from mitsuba_taxel.mechanics.equilibrium.stability import Stability
from mitsuba_taxel.pads import Pad

LAW = NeoHookean()
CASES = [
    (list(MIRRORS), SpreadForce(), (0, 0, -2.0)),
    (list(MIRRORS), PlateForce(), (0, 0, -2.0)),
    (list(MIRRORS), Pressure(), (0.1,)),
    ([ACROSS_X, ACROSS_Y], SpreadForce(), (0, 0, -2.0)),
    ([ACROSS_SECOND_DIAGONAL, ACROSS_DIAGONAL], Pressure(), (0.1,)),
]


@pytest.mark.parametrize("is_large", [False, True])
@pytest.mark.parametrize(("mirrors", "load", "value"), CASES)
def test_the_pieces_have_the_energy_of_the_whole(mirrors, load, value, is_large, symmetric_block, monkeypatch):
    """The second variation of the energy, of displacements without any symmetry, at a pressed state.

    That of the whole is summed over its elements alone; what the pressure in the cuts adds to the pieces has to cancel.
    """
    if is_large:  # pieces are made anew for each state
        monkeypatch.setattr(stability, "FEW_UNKNOWNS", 0)
    mesh = symmetric_block((3.6, 3.6, 3.0), (2, 2, 3))
    images, value = node_images(mesh), np.array(value, dtype=float)
    pad = LoadedPad(mesh, LAW, load, mirrors, images)
    unknowns = pad.solve_symmetric(np.zeros(pad.unknowns), value)[0].unknowns
    state = pad.split(unknowns)

    of_whole = Model(part_between(mesh, {}, ()), LAW, load, {})
    pieces = Stability(mesh, tuple(mirrors), images, pad.model, None).pieces
    restricted = pad.part.restrict(*state)
    entries = pad.model.evaluate(*restricted, value).entries
    with_pressure = pieces.with_pressure(entries, *state)
    assert not np.allclose(with_pressure, entries, rtol=1e-6)

    kept = pad.part.walls[-1]
    cuts = [mirror for mirror in mirrors if mirror is not kept]
    if len(mirrors) == len(MIRRORS):
        cuts = [ACROSS_X, ACROSS_Y]
    corners = mesh.points[: mesh.corner_count]
    in_cut = np.any([mirror.side(corners) == 0 for mirror in cuts], axis=0)
    unknown = np.random.default_rng(7).normal(size=of_whole.assembly.unknowns)
    displacement, pressure = of_whole.numbering.split(unknown)
    pressure = np.where(in_cut, 0.0, pressure)
    whole = form(of_whole, of_whole.evaluate(*state, value).entries, displacement, pressure)

    total = 0.0
    for here in orbit(displacement, pressure, images, cuts):
        image = mirrored(*here, images, kept)
        for block, sign in zip(pieces.blocks, (1, -1), strict=True):
            half = [0.5 * (own + sign * other) for own, other in zip(here, image, strict=True)]
            total += 2 * form(block.model, with_pressure, *pad.part.restrict(*half))
    assert total == pytest.approx(whole, rel=1e-9)


def test_the_blocks_hold_every_displacement(symmetric_block):
    """As many unknowns as the whole has; the last block of a square counts twice."""
    mesh = symmetric_block((3.6, 3.6, 3.0), (2, 2, 3))
    images = node_images(mesh)
    pad = LoadedPad(mesh, LAW, SpreadForce(), MIRRORS, images)
    stability = Stability(mesh, tuple(MIRRORS), images, pad.model, None)
    assert stability.of_all
    *others, pairs = (block.model.assembly.unknowns for block in stability._blocks)
    whole = Model(part_between(mesh, {}, ()), LAW, SpreadForce(), {})
    assert sum(others) + 2 * pairs == whole.assembly.unknowns


def form(model, entries, displacement, pressure):
    matrix = model.assembly.matrix(entries)
    vector = model.numbering.gather(displacement, pressure)
    if model.numbering.plate is not None:  # gathered from the nodes of the top
        np.testing.assert_allclose(model.numbering.split(vector)[0], displacement, atol=1e-12)
    return 2 * vector @ (matrix @ vector) - vector @ (matrix.diagonal() * vector)


def mirrored(displacement, pressure, images, mirror):
    image = images[mirror]
    return mirror.image(displacement[image]), pressure[image[: len(pressure)]]


def orbit(displacement, pressure, images, mirrors):
    """A state and its images under the group that some mirrors make."""
    states = [(displacement, pressure)]
    for mirror in mirrors:
        states += [mirrored(*state, images, mirror) for state in states]
    return states


def test_a_stable_pad_needs_two_small_matrices(fresh, monkeypatch):
    """Beside those of the part; the blocks would take four, one of them of twice the size."""
    sizes = []
    factor = solvers.Rslab.factor

    def counting(self, lower):
        sizes.append(lower.shape[0])
        return factor(self, lower)

    monkeypatch.setattr(solvers.Rslab, "factor", counting)
    pad = Pad("hemispheric", rows=2, columns=2)
    (state,) = load_path(pad, LAW, [(0, 0, -2.0)], mesh_size=2.0)
    assert state.stability_checked
    own = sizes[0]
    others = [size for size in sizes if size != own]
    assert len(others) == 2 and max(others) < 1.1 * own


def test_a_state_may_be_stable_beyond_an_unstable_one(fresh, monkeypatch, thin_walled):
    """So it does not do to test the last of a path."""
    pad, load = Pad(rows=1, columns=1, wall=0.05), PlateDisplacement()
    monkeypatch.setattr(path_problem, "pad_mesh", lambda pad, size: thin_walled(pad, 2, 4))
    path = pad_path(pad, LAW, load, 2.0, judged=False)
    value = np.array((0.0, 0.0, -0.2))
    path.state(value)
    ((segment, _),) = path.segments.to(value)
    part = path.segments.pad_for(segment.origin, segment.direction)

    def surplus(node):
        state, value = part.split(node.unknowns), segment.value(node.s)
        entries = part.model.evaluate(*part.part.restrict(*state), value).entries
        return part._stability.surplus(entries, *state, value)

    middle = next(node for node in segment.nodes if node.s > 0.06)
    assert surplus(middle) == 1 and surplus(segment.nodes[-1]) == 0


def test_a_path_may_be_judged_on_larger_elements(fresh, monkeypatch):
    """The same states at less cost, compared with those of the judge; and judged itself where the judge's path ends."""
    pad = Pad("hemispheric", rows=1, columns=1)
    node = LONGER_PRESSED * natural_step(pad.mesh(1.25), LAW, SpreadForce())  # of all paths, whatever their steps
    asked = {"values": [(0, 0, -node)], "mesh_size": 1.25}
    (by_itself,), (by_larger,) = load_path(pad, LAW, **asked), load_path(pad, LAW, judged_on=2.5, **asked)
    np.testing.assert_allclose(by_larger.displacement, by_itself.displacement, rtol=0, atol=1e-8)
    assert astuple(by_larger.error) == pytest.approx(astuple(by_itself.error), rel=1e-4)  # 2.5 mm is twice 1.25 mm
    monkeypatch.setattr(PadPath, "bears", lambda path, value: False)
    (again,) = load_path(pad, LAW, judged_on=2.5, **asked)
    np.testing.assert_array_equal(again.displacement, by_itself.displacement)


def test_a_sharp_edge_is_unstable_under_a_force_of_constant_direction_at_all_lengths():
    """In plane strain, a finite-element computation of its own: the smaller the elements, the less is needed, and with
    an end, since the shape of the mode repeats itself in the logarithm of the distance from the edge."""
    least = [_critical_traction(levels) for levels in (6, 12, 20, 30)]
    assert np.all(np.diff(least) < 0) and 0.92 < least[-1] < 0.96
    assert least[0] == pytest.approx(1.18, abs=0.02)
    lengths = np.array([6, 12, 20, 30]) * np.log(1 / 0.6)
    end, slope = np.polynomial.polynomial.polyfit((np.pi / lengths[1:]) ** 2, least[1:], 1)
    assert 0.9 < end < least[-1] and slope > 0


def _critical_traction(levels: int) -> float:
    """Nominal pressure, in shear moduli, at which the free edge of an incompressible quarter-space is unstable.

    It is a square clamped at its far sides, in elements that shrink towards the edge by 0.6 from one to the next.
    """
    places = -np.concatenate([[0.0], 0.6 ** np.arange(levels, -1, -1)])
    count = len(places)
    corner = np.arange(count**2).reshape(count, count)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    corners = np.stack(np.meshgrid(places, places, indexing="ij"), axis=-1).reshape(-1, 2)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    points = np.concatenate([corners, corners[edges].mean(axis=1)])
    nodes = np.concatenate([triangles, len(corners) + number.reshape(-1, 3)], axis=1)
    unstable, stable = 0.5, 1.0
    for _ in range(12):
        stretch = 0.5 * (unstable + stable)
        unstable, stable = (stretch, stable) if _surplus(points, nodes, stretch) else (unstable, stretch)
    return 1 / stable**3 - stable


def _surplus(points: np.ndarray, nodes: np.ndarray, stretch: float) -> int:
    """Number of negative eigenvalues of the second variation of int |F|^2 / 2 - q (J - 1) beyond those of q, where the
    square is stretched along its second axis: the force's own is zero."""
    inverse, q = np.array([stretch, 1 / stretch]), stretch**-2  # no traction on the side
    p = points[nodes[:, :3]]
    along = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2)
    area, back = np.abs(np.linalg.det(along)) / 2, np.linalg.inv(along)
    slope = np.array([[-1.0, -1], [1, 0], [0, 1]])
    corners, dofs = int(nodes[:, :3].max()) + 1, (2 * nodes[:, :, None] + [0, 1]).reshape(-1, 12)
    stiffness, volumes = np.zeros((len(nodes), 12, 12)), np.zeros((len(nodes), 3, 12))
    for share in np.full((3, 3), 1 / 6) + np.eye(3) / 2:
        on_sides = [share[i] * slope[j] + share[j] * slope[i] for i, j in ((0, 1), (1, 2), (2, 0))]
        shapes = np.concatenate([(4 * share - 1)[:, None] * slope, 4 * np.array(on_sides)]) @ back
        gradient = np.einsum("maj,ic->mijac", shapes, np.eye(2)).reshape(len(nodes), 2, 2, 12)
        pulled = gradient * inverse[:, None]
        both = np.einsum("mijk,mijl->mkl", gradient, gradient) + q * np.einsum("mijk,mjil->mkl", pulled, pulled)
        stiffness += area[:, None, None] / 3 * both
        volumes += area[:, None, None] / 3 * share[:, None] * np.einsum("miik->mk", pulled)[:, None]
    free = np.flatnonzero(np.repeat((points > -1 + 1e-12).all(axis=1), 2))
    rows, columns = dofs.repeat(12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    upper = sparse.csr_array((stiffness.ravel(), (rows, columns)))[free][:, free]
    rows, columns = nodes[:, :3].repeat(12, axis=1).ravel(), np.tile(dofs, (1, 3)).ravel()
    lower = sparse.csr_array((volumes.ravel(), (rows, columns)), shape=(corners, 2 * len(points)))[:, free]
    scale = sparse.diags_array(upper.diagonal() ** -0.5)
    upper, lower = scale @ upper @ scale, lower @ scale
    lower = sparse.diags_array(1 / sparse.linalg.norm(lower, axis=1)) @ lower
    matrix = sparse.block_array([[upper, lower.T], [lower, -1e-7 * sparse.eye_array(corners)]])
    factor = solvers.make_solver().factor(sparse.csc_matrix(sparse.tril(matrix)))
    return factor.negative_pivots - corners
