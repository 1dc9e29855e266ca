"""Symmetric tensors as their six components xx, yy, zz, xy, yz, xz."""

from __future__ import annotations

import numpy as np

_ROWS, _COLUMNS = (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)
_PLACES = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


def tensors(components: np.ndarray) -> np.ndarray:
    """(..., 3, 3) tensors of their components (..., 6)."""
    return components[..., _PLACES]


def components(tensors: np.ndarray) -> np.ndarray:
    """(..., 6) components of tensors (..., 3, 3)."""
    return tensors[..., _ROWS, _COLUMNS]
