"""Fit of the measured pad's height and modulus, and of the indenter's radius, to the record of one taxel.

The force of a neo-Hookean pad at a given travel is proportional to its modulus, so that the best modulus for each
height and radius has a closed form. A record may begin some time after the first contact. Height and radius are found
by least squares. The logarithms of forces and changes are taken as linear in the logarithms of height and radius; their
derivatives are updated by Broyden's method, because each curve needs a finite-element load path (C. G. Broyden, 1965).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares, minimize_scalar

DIFFERENCE = 0.1
"""Relative step of an unknown for the first derivatives, which are finite differences."""
LONGEST = 0.25
"""Largest relative change of an unknown in one step."""
SETTLED = 0.02
"""Relative change of the unknowns below which the search ends."""
MOST_STEPS = 6
UNKNOWNS = 4
LATEST = 0.3
"""Largest travel in mm at which a record may begin."""
DIGITS = 3
"""Number of significant digits to which unknowns are rounded, so that stored load paths are found again."""


class PressedTaxel(NamedTuple):
    """Curve of a pressed taxel, measured or computed, at S travels.

    Attributes
    ----------
    travel : (S,) ndarray
        Travel of the indenter in mm.
    force : (S,) ndarray
        Force in N; computed forces are those for a modulus of 1 MPa.
    change : (S,) ndarray
        Change of the reading, relative to rest.
    """

    travel: np.ndarray
    force: np.ndarray
    change: np.ndarray

    def at(self, travel: np.ndarray) -> PressedTaxel:
        """The curve at other travels, by a spline that starts at rest; NaN beyond the end of the curve."""
        knots = np.insert(self.travel, 0, 0.0)
        values = [
            CubicSpline(knots, np.insert(y, 0, 0.0), bc_type="natural", extrapolate=False)(travel)
            for y in (self.force, self.change)
        ]
        return PressedTaxel(travel, *values)


class FittedPad(NamedTuple):
    """Result of a fit of the pad and its indenter.

    Attributes
    ----------
    unknowns : (2,) ndarray
        Height of the pad and radius of the indenter's end, in mm.
    modulus : float
        Young's modulus in MPa.
    late : float
        Travel in mm at which the record begins.
    deviations : (3,) ndarray
        Standard errors of height, radius and ``late`` in mm, from the scatter of the residuals.
    misfit : float
        Root mean square of the residuals of forces and changes, relative to the largest force and the largest change.
    tried : dict[tuple[float, ...], float]
        Misfit of each height and radius that was tried.
    incomplete : frozenset[tuple[float, ...]]
        Those of them whose load path ends before the last measured travel: their misfit is that of fewer travels.
    """

    unknowns: np.ndarray
    modulus: float
    late: float
    deviations: np.ndarray
    misfit: float
    tried: dict[tuple[float, ...], float]
    incomplete: frozenset[tuple[float, ...]] = frozenset()

    def travel(self, recorded: float) -> float:
        """Convert a travel of the record to the travel from the first contact, in mm, rounded to the digits in the name
        of a load path."""
        return round(recorded + self.late, 3)


def lateness(computed: PressedTaxel, measured: PressedTaxel) -> float:
    """Fit the travel in mm, at most `LATEST`, at which the record begins, by least squares."""
    solution = minimize_scalar(
        lambda late: np.square(residuals(computed, measured, late)).sum(),
        bounds=(0.0, LATEST),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return round(float(solution.x), DIGITS)


def modulus(computed: PressedTaxel, measured: PressedTaxel, late: float = 0.0) -> float:
    """Fit Young's modulus in MPa to the measured forces, by least squares.

    Forces are proportional to the modulus: those of a load path with 1 MPa are scaled, up to the end of that path. The
    measured travel starts ``late`` mm after the first contact.
    """
    force = computed.at(measured.travel + late).force
    borne = np.isfinite(force)
    return float(force[borne] @ measured.force[borne] / (force[borne] @ force[borne]))


def residuals(computed: PressedTaxel, measured: PressedTaxel, late: float = 0.0) -> np.ndarray:
    """Residuals (2 S,): errors of the S computed forces, with the best modulus, then of the S changes, each relative to
    the largest measured value.

    Beyond the end of the computed load path, the residuals are those at its last travel."""
    curve = computed.at(measured.travel + late)
    scaled = modulus(computed, measured, late) * curve.force
    errors = np.stack(
        [(scaled - measured.force) / measured.force.max(), (curve.change - measured.change) / measured.change.max()]
    )
    last = np.flatnonzero(np.isfinite(curve.force))[-1]
    errors[:, last + 1 :] = errors[:, last : last + 1]
    return errors.ravel()


def fit(
    pressed: Callable[[float, float], PressedTaxel], measured: PressedTaxel, start: tuple[float, float]
) -> FittedPad:
    """Fit height and radius such that the computed curve, ``pressed(height, radius)``, is closest to the measured
    curve.

    Load paths that end before the last measured travel guide the search, but are the result only if no path reaches it.
    """
    curves: dict[tuple[float, ...], PressedTaxel] = {}

    def computed(logs: np.ndarray) -> PressedTaxel:
        key = tuple(rounded(value) for value in np.exp(logs))
        if key not in curves:
            curves[key] = pressed(*key)
        return curves[key]

    logs_now, late = np.log(start), 0.0
    curve = computed(logs_now)
    varied = [computed(logs_now + row) for row in DIFFERENCE * np.eye(2)]
    count = min(len(curve_k.travel) for curve_k in (curve, *varied))
    slopes = np.stack([_logs(curve_k, count) - _logs(curve, count) for curve_k in varied], axis=-1) / DIFFERENCE
    for _ in range(MOST_STEPS):

        def misfit(unknowns: np.ndarray, logs_now=logs_now, curve=curve, slopes=slopes) -> np.ndarray:
            values = np.exp(_logs(curve, slopes.shape[1]) + slopes @ (unknowns[:2] - logs_now))
            return residuals(PressedTaxel(curve.travel[: slopes.shape[1]], *values), measured, unknowns[2])

        bounds = [-np.inf, -np.inf, 0.0], [np.inf, np.inf, LATEST]
        solution = least_squares(misfit, [*logs_now, late], bounds=bounds)
        late, step = solution.x[2], solution.x[:2] - logs_now
        step *= min(1.0, LONGEST / np.abs(step).max())
        next_curve = computed(logs_now + step)
        count = min(slopes.shape[1], len(next_curve.travel))
        slopes = slopes[:, :count]
        broyden_residual = _logs(next_curve, count) - _logs(curve, count) - slopes @ step
        slopes = slopes + broyden_residual[..., None] * step / (step @ step)
        logs_now, curve = logs_now + step, next_curve
        if np.abs(step).max() < SETTLED:
            break
    lates = {key: lateness(curve_k, measured) for key, curve_k in curves.items()}
    errors = {key: residuals(curve_k, measured, lates[key]) for key, curve_k in curves.items()}
    tried = {key: float(np.sqrt(np.mean(values**2))) for key, values in errors.items()}
    # A path that ends early has residuals at fewer travels, so that its misfit is not that of the record.
    reach = measured.travel[-1]
    complete = {key for key, curve_k in curves.items() if curve_k.travel[-1] >= reach + lates[key]}
    best = min(complete or tried, key=lambda key: tried[key])
    jacobian = np.asarray(solution.jac)
    spread = np.linalg.pinv(jacobian.T @ jacobian) * 2 * solution.cost / (len(solution.fun) - UNKNOWNS)
    deviations = np.sqrt(np.diag(spread)) * [*best, 1.0]
    stiffness = modulus(curves[best], measured, lates[best])
    incomplete = frozenset(tried.keys() - complete)
    return FittedPad(np.array(best), stiffness, lates[best], deviations, tried[best], tried, incomplete)


def _logs(curve: PressedTaxel, count: int) -> np.ndarray:
    """Logarithms (2, count) of forces and changes at the first ``count`` travels."""
    return np.log(np.stack([curve.force[:count], curve.change[:count]]))


def rounded(value: float) -> float:
    """Round an unknown to the digits in the name of a load path."""
    return float(f"{value:.{DIGITS}g}")
