"""Distinct rows of whole numbers."""

from __future__ import annotations

import numpy as np


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct rows of an array, in lexicographic order.

    The result is that of numpy's ``unique`` along an axis. It is several times as fast, as columns are sorted instead
    of rows.

    Parameters
    ----------
    rows : (R, C) ndarray
        Rows of numbers.

    Returns
    -------
    first : (U,) ndarray of int
        Index of the first occurrence of each distinct row.
    number : (R,) ndarray of int
        Index of each row among the distinct rows.
    """
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.empty_like(order)
    number[order] = np.cumsum(new) - 1
    return order[new], number
