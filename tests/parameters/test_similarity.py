"""Rigid motions with a uniform scale are told from other transformations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsuba_taxel import InputError
from mitsuba_taxel.parameters.similarity import similarity_scale

pytestmark = pytest.mark.quick


def transformation(linear):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, (1.0, -2.0, 3.0)
    return matrix


@pytest.mark.parametrize("scale", [1e-3, 1.0, 250.0])
def test_the_scale_is_found_however_a_part_is_turned(scale):
    for turn in Rotation.random(5, random_state=1).as_matrix():
        assert similarity_scale(transformation(scale * turn)) == pytest.approx(scale, rel=1e-12)


@pytest.mark.parametrize(
    "linear",
    [np.diag([1, 1, -1]), np.diag([1, 1, 1.001]), np.eye(3) + 0.001 * np.eye(3, k=1), np.zeros((3, 3))],
    ids=["mirror", "unequal", "shear", "flat"],
)
@pytest.mark.parametrize("scale", [1e-3, 250.0])
def test_others_are_refused(linear, scale):
    with pytest.raises(InputError, match="rigid motion with at most a uniform scale"):
        similarity_scale(transformation(scale * linear))
