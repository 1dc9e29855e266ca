"""The tangent at a state of more symmetry, in blocks, against that of the part between fewer mirrors."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import NeoHookean, PatchForce, PlateForce, SpreadForce
from mitsuba_taxel.mechanics.elements.solvers import symmetric_product
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import SplitTangent, tangent_blocks

LAW = NeoHookean()
VALUE = np.array([0.0, 0.0, -2.0])
CASES = [
    (MIRRORS, (ACROSS_Y,), SpreadForce(), 3),
    (MIRRORS, (ACROSS_X,), SpreadForce(), 3),
    (MIRRORS, (ACROSS_DIAGONAL,), SpreadForce(), 3),
    (MIRRORS, (ACROSS_SECOND_DIAGONAL,), SpreadForce(), 3),
    (MIRRORS, (), SpreadForce(), 6),
    (MIRRORS, (ACROSS_Y,), PlateForce(), 3),
    (MIRRORS, (ACROSS_DIAGONAL,), PlateForce(), 3),
    ((ACROSS_X, ACROSS_Y), (ACROSS_Y,), SpreadForce(), 2),
    ((ACROSS_X, ACROSS_Y), (), PlateForce(), 4),
    ((ACROSS_Y,), (ACROSS_Y,), PatchForce((0.5, 0.0), (1.0, 1.0)), 1),
    ((ACROSS_Y,), (), PatchForce((0.5, 0.0), (1.0, 1.0)), 2),
]


@pytest.mark.parametrize(("mirrors", "fewer", "load", "count"), CASES)
def test_it_solves_with_the_tangent_of_the_part(mirrors, fewer, load, count, symmetric_block):
    """Of a random residual, without any symmetry of its own."""
    mesh = symmetric_block((3.6, 3.6, 3.0), (2, 2, 2))
    images = node_images(mesh)
    pressed = LoadedPad(mesh, LAW, load, mirrors, images)
    solution, _ = pressed.solve_linearised(np.zeros(pressed.unknowns), VALUE)
    state = pressed.split(solution.unknowns)
    factored = []

    def factor(block):
        on_part = block.model.part.restrict(*state)
        factored.append(block)
        return block.factored(block.model.evaluate(*on_part, VALUE).entries, on_part[0], VALUE).factor

    pad = LoadedPad(mesh, LAW, load, fewer, images)
    split = SplitTangent(pad, tangent_blocks(pressed), factor, images)
    assert len(factored) == count
    lower = pad.model.assembly.matrix(pad.model.evaluate(*pad.part.restrict(*state), VALUE).entries)
    residual = np.random.default_rng(1).standard_normal(pad.unknowns)
    left = residual - symmetric_product(lower, split.step(residual))
    assert np.linalg.norm(left) < 2e-2 * np.linalg.norm(residual)  # factors are of single precision
