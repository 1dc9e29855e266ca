"""A column that buckles, against the elastica; and a pad of two cells with thin walls that do."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

from mitsuba_taxel.geometry.mirror import ACROSS_X, ACROSS_Y
from mitsuba_taxel.mechanics import NeoHookean, SpreadForce
from mitsuba_taxel.mechanics.path.buckled_branch import BuckledBranch
from mitsuba_taxel.mechanics.path.load_segment import LoadSegment
from mitsuba_taxel.mechanics.path.loaded_pads import loaded_pad
from mitsuba_taxel.mechanics.path.onset_of_buckling import find_onset

LENGTH, WIDTH, MODULUS = 16.0, 2.0, 4.0
EULER = MODULUS * np.pi**2 / 48 * WIDTH / LENGTH**2
"""Of a column of unit thickness that is clamped below and free above."""


def bent(load):
    """Deflection of the end of an elastica under a load relative to Euler's, relative to its length."""
    modulus = brentq(lambda m: (2 * ellipk(m) / np.pi) ** 2 - load, 1e-9, 0.5)
    return 2 * np.sqrt(modulus) / ellipk(modulus)


@pytest.fixture
def column(symmetric_block):
    """The pad, and the segment that it bears straight."""
    mesh = symmetric_block((1.0, WIDTH, LENGTH), (1, 1, 8))
    pad = loaded_pad(mesh, NeoHookean(MODULUS, 0.0), SpreadForce(), (ACROSS_X, ACROSS_Y))
    segment = LoadSegment(np.zeros(3), np.array([0.0, 0.0, -1.0]), 4 * EULER, judged=True)
    segment.extend(pad, 2 * EULER, partial(np.zeros, pad.unknowns), pad.contact, lambda: False)
    return pad, segment


def test_an_elastica(column):
    pad, segment = column
    print(segment.limit, segment.reason, [n.s for n in segment.nodes], EULER)
    onset = find_onset(pad, segment)
    assert onset.node.s == pytest.approx(EULER, rel=0.05)
    segment.end_buckling(pad, pad.contact, *onset)
    kept = loaded_pad(pad.whole, pad.material, pad.load, (ACROSS_Y,))
    branch = BuckledBranch(kept, segment, pad.split(onset.node.unknowns))
    branch.extend(1.05 * segment.limit, lambda: False)
    top = pad.whole.points[:, 2] == LENGTH
    for load in (1.001, 1.01, 1.03, 1.05):
        print(load, kept.split(branch.at(load * segment.limit).unknowns)[0][top, 0].mean() / LENGTH, bent(load))
    print([(n.s, n.unknowns[-1] / segment.limit, n.iterations) for n in branch.curve.nodes])
