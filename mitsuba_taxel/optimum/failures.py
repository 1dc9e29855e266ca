"""Estimated boundary between designs that can be evaluated and designs that fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from mitsuba_taxel.optimum.search import Linearisation

LEAST_GAP = 1e-3
"""Smallest distance, relative to the bounds' width, between points that are separated by a plane."""


def off_failures(
    x: np.ndarray, here: Linearisation, readable: Sequence[np.ndarray], failed: Sequence[np.ndarray]
) -> Linearisation:
    """Add a limit that keeps steps away from designs whose evaluation failed.

    The limit is a plane midway between the convex hulls of readable and failed points, where these are nearest (the
    support vectors of C. Cortes and V. Vapnik, 1995). Where the hulls intersect, the plane separates ``x`` from failed
    points. If ``x`` is very close to a failed point, there is no additional limit.

    Parameters
    ----------
    x : (V,) ndarray
        Current point.
    here : Linearisation
        Goals and limits at that point.
    readable, failed : Sequence[(V,) ndarray]
        Points that could be evaluated, and points that failed.
    """
    for hull in (np.array(readable), x[None]) if len(failed) else ():
        nearest_readable, nearest_failed = nearest(hull, np.array(failed))
        gap = float(np.linalg.norm(nearest_failed - nearest_readable))
        if gap > LEAST_GAP:
            normal = (nearest_failed - nearest_readable) / gap
            margin = normal @ (0.5 * (nearest_readable + nearest_failed) - x)
            return replace(
                here, limits=np.append(here.limits, margin), limit_rates=np.vstack([here.limit_rates, -normal])
            )
    return here


def nearest(points: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the points, one in the convex hull of ``points`` (N, V) and one in that of ``others`` (M, V), that are
    nearest to each other. Returns both, each (V,).
    """
    heavy = 1e3  # enforces that the weights of either set sum to 1
    sums = heavy * np.repeat(np.eye(2), [len(points), len(others)], axis=1)
    weights, _ = nnls(np.vstack([np.concatenate([points, -others]).T, sums]), [0.0] * points.shape[1] + [heavy] * 2)
    weights_points, weights_others = np.split(weights, [len(points)])
    return weights_points @ points / weights_points.sum(), weights_others @ others / weights_others.sum()
