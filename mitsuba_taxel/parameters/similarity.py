"""Rigid motions with at most a uniform scale, the only transformations that plugins of this package take."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError


def similarity_scale(matrix: np.ndarray) -> float:
    """Scale factor of a similarity transformation: a rigid motion with a uniform scale.

    Parameters
    ----------
    matrix : (4, 4) ndarray
        The transformation in homogeneous coordinates.

    Returns
    -------
    float
        Scale, above 0.

    Raises
    ------
    InputError
        if the transformation shears, mirrors, or scales the axes differently.
    """
    linear = matrix[:3, :3]
    scale = float(np.cbrt(np.linalg.det(linear)))
    if not scale > 0 or not np.allclose(linear.T @ linear, scale**2 * np.eye(3), atol=1e-4 * scale**2):
        raise InputError("to_world must be a rigid motion with at most a uniform scale (no shear, no mirror).")
    return scale
