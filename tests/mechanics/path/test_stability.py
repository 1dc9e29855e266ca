"""Stability against displacements that lack a state's symmetry: where pieces of a pad tell it, that costs little."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import NeoHookean, PlateDisplacement, PlateForce, Pressure, SpreadForce, load_path
from mitsuba_taxel.mechanics.elements import solvers
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between
from mitsuba_taxel.mechanics.path.equilibrium import LoadedPad, natural_step
from mitsuba_taxel.mechanics.path.pad_path import LONGER_PRESSED, PadPath, pad_path
from mitsuba_taxel.mechanics.path.stability import Stability
from mitsuba_taxel.pads import Pad

LAW = NeoHookean()
CASES = [
    (list(MIRRORS), SpreadForce(), (0, 0, -2.0)),
    (list(MIRRORS), PlateForce(), (0, 0, -2.0)),
    (list(MIRRORS), Pressure(), (0.1,)),
    ([ACROSS_X, ACROSS_Y], SpreadForce(), (0, 0, -2.0)),
    ([ACROSS_SECOND_DIAGONAL, ACROSS_DIAGONAL], Pressure(), (0.1,)),
]


@pytest.mark.parametrize(("mirrors", "load", "value"), CASES)
def test_the_pieces_have_the_energy_of_the_whole(mirrors, load, value, symmetric_block):
    """The second variation of the energy, of displacements without any symmetry, at a pressed state.

    That of the whole is summed over its elements alone; what the pressure in the cuts adds to the pieces has to cancel.
    """
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


def test_a_state_may_be_stable_beyond_an_unstable_one(fresh):
    """So it does not do to test the last of a path."""
    pad, load = Pad(rows=1, columns=1, wall=0.05), PlateDisplacement()
    path = pad_path(pad, LAW, load, 2.0, judged=False)
    value = np.array((0.0, 0.0, -0.17))
    path.state(value)
    ((segment, _),) = path.segments_to(value)
    part = path.pad_for(segment.origin, segment.direction)

    def surplus(node):
        state, value = part.split(node.unknowns), segment.value(node.s)
        entries = part.model.evaluate(*part.part.restrict(*state), value).entries
        return part._stability.surplus(entries, *state, value)

    middle = next(node for node in segment.nodes if node.s > 0.11)
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
