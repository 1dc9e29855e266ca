"""Height, modulus and end of the indenter of the measured pad, from one taxel alone.

The force of a neo-Hookean pad at a given travel is proportional to its modulus, which therefore has a closed form for
each shape. The other unknowns are found by least squares on their logarithms, by Gauss's and Newton's method with
Broyden's update of the derivatives, as each residual costs a path of finite elements (C. G. Broyden, 1965).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

DIFFERENCE = 0.1
"""Relative change of an unknown for the first derivatives."""
LONGEST = 0.25
"""Largest relative change of an unknown in a step."""
SETTLED = 0.02
"""Relative change of the unknowns below which the search ends."""
MOST_STEPS = 6
DIGITS = 3
"""Significant digits of the unknowns, so that paths are found again."""


class Curve(NamedTuple):
    """One taxel pressed to some travels.

    Attributes
    ----------
    travel : (S,) ndarray
        In mm.
    force : (S,) ndarray
        In N; for a modulus of 1 MPa if computed.
    change : (S,) ndarray
        Of the reading, relative to rest.
    """

    travel: np.ndarray
    force: np.ndarray
    change: np.ndarray

    def at(self, travel: np.ndarray) -> Curve:
        """The curve at other travels, by a spline through rest; NaN beyond its end."""
        through = np.insert(self.travel, 0, 0.0)
        values = [
            CubicSpline(through, np.insert(y, 0, 0.0), bc_type="natural", extrapolate=False)(travel)
            for y in (self.force, self.change)
        ]
        return Curve(travel, *values)


class Found(NamedTuple):
    """What a fit found.

    Attributes
    ----------
    unknowns : (2,) ndarray
        Height of the pad and radius of the indenter's end, in mm.
    modulus : float
        In MPa.
    misfit : float
        Root mean square of the residuals of forces and changes, each relative to its largest.
    tried : dict[tuple[float, ...], float]
        Misfit of each height and radius that was tried.
    """

    unknowns: np.ndarray
    modulus: float
    misfit: float
    tried: dict[tuple[float, ...], float]


def modulus(computed: Curve, measured: Curve) -> float:
    """The modulus in MPa by least squares of the forces as far as the path computed with 1 MPa goes."""
    here = computed.at(measured.travel).force
    borne = np.isfinite(here)
    return float(here[borne] @ measured.force[borne] / (here[borne] @ here[borne]))


def residuals(computed: Curve, measured: Curve) -> np.ndarray:
    """(2 S,) errors of the forces, with the best modulus, and of the changes, each relative to its largest.

    Beyond the end of the computed path, errors are those at its last travel.
    """
    here = computed.at(measured.travel)
    scaled = modulus(computed, measured) * here.force
    found = np.stack(
        [
            (scaled - measured.force) / measured.force.max(),
            (here.change - measured.change) / measured.change.max(),
        ]
    )
    last = np.flatnonzero(np.isfinite(here.force))[-1]
    found[:, last + 1 :] = found[:, last : last + 1]
    return found.ravel()


def fit(pressed: Callable[[float, float], Curve], measured: Curve, start: tuple[float, float]) -> Found:
    """Height and radius whose curve, computed by ``pressed(height, radius)``, is nearest to the measured one."""
    known: dict[tuple[float, ...], np.ndarray] = {}

    def error(logs: np.ndarray) -> np.ndarray:
        key = tuple(rounded(value) for value in np.exp(logs))
        if key not in known:
            known[key] = residuals(pressed(*key), measured)
        return known[key]

    here = np.log(start)
    left = error(here)
    slopes = np.stack([(error(here + row) - left) / DIFFERENCE for row in DIFFERENCE * np.eye(2)], axis=1)
    for _ in range(MOST_STEPS):
        step = np.linalg.lstsq(slopes, -left, rcond=None)[0]
        step *= min(1.0, LONGEST / np.abs(step).max())
        there = error(here + step)
        slopes += np.outer(there - left - slopes @ step, step) / (step @ step)
        if there @ there < left @ left:
            here, left = here + step, there
        if np.abs(step).max() < SETTLED:
            break
    tried = {key: float(np.sqrt(np.mean(values**2))) for key, values in known.items()}
    best = min(tried, key=lambda key: tried[key])
    return Found(np.array(best), modulus(pressed(*best), measured), tried[best], tried)


def rounded(value: float) -> float:
    """To the digits that name a path."""
    return float(f"{value:.{DIGITS}g}")
