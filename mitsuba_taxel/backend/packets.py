"""Arrays of numbers in memory that is suitable for the kernels of Dr.Jit.

On a CPU Dr.Jit uses the memory of a NumPy array directly. Kernels read packets of up to 16 numbers, and therefore read
beyond the end of the array, which ends the process if the next page of memory is not mapped. Kernels are compiled for
the alignment of the array, so that the same kernel is compiled again for memory of another alignment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike

PACKET = 16
"""Largest number of values in a packet."""
ALIGNMENT = 64
"""Size in bytes of a packet of 32-bit numbers."""


def in_packets(values: np.ndarray, dtype: DTypeLike = np.float32) -> np.ndarray:
    """Copy an array, row by row, into complete and aligned packets.

    Parameters
    ----------
    values : ndarray
        Array of any shape, with N numbers.
    dtype : DTypeLike
        Type of the copy.

    Returns
    -------
    (N,) ndarray
        Copy that is aligned in memory.
    """
    kind = np.dtype(dtype)
    buffer = np.empty((values.size + PACKET) * kind.itemsize + ALIGNMENT, np.uint8)
    start = -buffer.ctypes.data % ALIGNMENT
    copy = buffer[start : start + values.size * kind.itemsize].view(kind)
    copy[:] = values.ravel()
    return copy
