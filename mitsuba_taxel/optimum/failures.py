"""Where designs fail, as estimated from those that did and those that did not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from mitsuba_taxel.optimum.search import Judged

LEAST_GAP = 1e-3
"""Relative to the bounds' width: what is read and what fails is not told apart by less."""


def off_failures(x: np.ndarray, here: Judged, readable: Sequence[np.ndarray], failed: Sequence[np.ndarray]) -> Judged:
    """The point ``x`` with one more limit, that steps stay on its side of a plane between points of both kinds.

    The plane lies midway between their convex hulls, where these are nearest (the support vectors of C. Cortes and
    V. Vapnik, 1995). Where the hulls meet, ``x`` stands for all readable points. None is added next to a failure.
    """
    for hull in (np.array(readable), x[None]) if len(failed) else ():
        one, other = nearest(hull, np.array(failed))
        gap = float(np.linalg.norm(other - one))
        if gap > LEAST_GAP:
            normal = (other - one) / gap
            margin = normal @ (0.5 * (one + other) - x)
            return replace(
                here, limits=np.append(here.limits, margin), limit_rates=np.vstack([here.limit_rates, -normal])
            )
    return here


def nearest(points: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nearest points (V,) of the convex hulls of ``points`` (N, V) and ``others`` (M, V)."""
    heavy = 1e3  # enforces that the weights of each sum to 1
    sums = heavy * np.repeat(np.eye(2), [len(points), len(others)], axis=1)
    weights, _ = nnls(np.vstack([np.concatenate([points, -others]).T, sums]), [0.0] * points.shape[1] + [heavy] * 2)
    one, other = np.split(weights, [len(points)])
    return one @ points / one.sum(), other @ others / other.sum()
