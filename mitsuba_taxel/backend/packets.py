"""Arrays of numbers in memory that Dr.Jit's kernels can use.

On a CPU Dr.Jit takes the memory of an array of NumPy's as it is. Kernels read it a packet of up to 16 numbers at a time
and thus beyond its end, which ends the process where the next page of memory is not mapped; and they are compiled for
its alignment, so that the same kernel is compiled again for memory that begins elsewhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike

PACKET = 16
"""Numbers in the largest packet."""
ALIGNMENT = 64
"""Bytes of a packet of 32-bit numbers."""


def in_packets(values: np.ndarray, dtype: DTypeLike = np.float32) -> np.ndarray:
    """Copy of all numbers of an array, row by row, in whole and aligned packets.

    Parameters
    ----------
    values : ndarray
        Of any shape, with N numbers.
    dtype : DTypeLike
        Of the copy.

    Returns
    -------
    (N,) ndarray
        Aligned in memory.
    """
    kind = np.dtype(dtype)
    buffer = np.empty((values.size + PACKET) * kind.itemsize + ALIGNMENT, np.uint8)
    start = -buffer.ctypes.data % ALIGNMENT
    copy = buffer[start : start + values.size * kind.itemsize].view(kind)
    copy[:] = values.ravel()
    return copy
