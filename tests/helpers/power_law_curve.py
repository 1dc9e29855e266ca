"""Curves of error against work that are power laws."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, WorkPoint


def line(exponent, launch=0.0, count=8, floor=0.0, noise=None, readings=8, launched=False):
    """A curve whose error falls with a power of its work, the seconds beyond launching."""
    work = 0.01 * 2.0 ** np.arange(count)
    error = 1e-3 * work**exponent * np.exp(0 if noise is None else noise)
    points = [
        WorkPoint(str(n), launch + s, math.hypot(e, floor), e, floor, "truth", 4, readings)
        for n, (s, e) in enumerate(zip(work, error, strict=True))
    ]
    return ErrorCurve("optics", "line", points, launched)
