"""Numbers and vectors for kernels, which read beyond the end of arrays of NumPy's."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mitsuba_taxel.backend.packets import in_packets


def floats(mi: Any, values: ArrayLike) -> Any:
    """(N,) ``mi.Float`` of numbers."""
    return mi.Float(in_packets(np.asarray(values)))


def vectors(mi: Any, *components: ArrayLike) -> Any:
    """(N,) ``mi.Vector3f`` of three components, of which any may be one number."""
    return mi.Vector3f(*(floats(mi, part) for part in np.broadcast_arrays(*components)))
