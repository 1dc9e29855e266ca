"""Least-squares fit of one law to the curves of all tests, with errors of its constants and of its predictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.candidates import Candidate
from mitsuba_taxel.fitting.material.curves import StressCurve
from mitsuba_taxel.fitting.material.noise import CurveNoise, taken_up
from mitsuba_taxel.mechanics.materials.drucker import stable_stretch
from mitsuba_taxel.mechanics.materials.laws import Material

PROBABILITY = 0.95
BEST_STARTS = 3
"""Number of start values from which fits are completed."""
STEP = 1e-6
"""Relative step of finite differences with respect to shape parameters and slacks."""


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to tests: p constants, c test curves with n rows altogether.

    The slack of a curve is the strain at which its specimen becomes taut, if this differs from 0.

    Attributes
    ----------
    candidate : Candidate
        The law.
    constants : (p,) ndarray
        Constants in the order of ``candidate.names``.
    covariance : (p, p) ndarray
        Covariance of the errors of the constants; the variance is infinite for constants that the tests do not
        determine.
    low, high : (p,) ndarray
        Ends of 95 % intervals.
    slacks, slack_errors : (c,) ndarray
        Slack of each curve as nominal strain, and its standard deviation.
    stress : list[ndarray]
        Fitted nominal stress of each curve in MPa.
    misfit : float
        Root mean square of the residuals, relative to the noise of the tests.
    rms : float
        Root mean square of the residuals, relative to the largest stress of their curve.
    predicted : (n,) ndarray
        Residuals of leave-one-out cross-validation, relative to the noise: the residual of each row is from a fit
        without this row.
    cross_validated : float
        Root mean square of the cross-validated residuals, relative to the largest stress of their curve.
    material : Material or None
        The law with its constants; None if it is refused or left out.
    stable : float
        Principal stretch up to which the law is stable.
    refusal : str
        Reason why the law is refused; empty if it is not.
    possible_slacks : (2, c) ndarray
        Least and largest slack of each curve that is compatible with the tests, as included in the intervals; zeros if
        the intervals include ``slacks`` only.
    """

    candidate: Candidate
    constants: np.ndarray
    covariance: np.ndarray
    low: np.ndarray
    high: np.ndarray
    slacks: np.ndarray
    slack_errors: np.ndarray
    stress: list[np.ndarray]
    misfit: float
    rms: float
    predicted: np.ndarray
    cross_validated: float
    material: Material | None
    stable: float
    refusal: str
    possible_slacks: np.ndarray


class Tests:
    """The rows of all curves of material tests in common arrays, with the noise of each row.

    Parameters
    ----------
    curves : list[StressCurve]
        Loading branches.
    noises : list[CurveNoise]
        Noise of each curve.
    """

    __test__ = False

    def __init__(self, curves: list[StressCurve], noises: list[CurveNoise]) -> None:
        self.curves = curves
        self.deviation = np.concatenate([noise.deviation for noise in noises])
        self.measured = np.concatenate([curve.stress for curve in curves])
        self.largest = np.concatenate([np.full(len(c.lines), np.abs(c.stress).max()) for c in curves])
        self.slacks = np.array([noise.slack for noise in noises])
        self.free = np.flatnonzero(self.slacks)
        self.ends = np.cumsum([len(curve.lines) for curve in curves])[:-1]

    def columns(self, candidate: Candidate, shapes: Any, slacks: np.ndarray) -> np.ndarray:
        """Terms (n, m) of a law, as columns for linear least squares, divided by the noise of each of n rows."""
        pairs = zip(self.curves, slacks, strict=True)
        rows = [candidate.columns(curve.mode, taken_up(curve, slack), tuple(shapes)) for curve, slack in pairs]
        return np.concatenate(rows) / self.deviation[:, None]


def fit_law(candidate: Candidate, tests: Tests, *, constants_only: bool = False) -> LawFit | None:
    """Fit the constants of one law to all tests by least squares.

    Parameters
    ----------
    candidate : Candidate
        The law.
    tests : Tests
        Curves and their noise.
    constants_only : bool
        Whether the law itself, its stability and its refusal are left out, which takes less time.

    Returns
    -------
    LawFit or None
        None if there are too few rows for its constants.
    """
    from scipy.optimize import least_squares, nnls
    from scipy.special import stdtrit

    count, shapes = len(candidate.moduli), len(candidate.shapes)
    rows = len(tests.measured)
    freedom = rows - count - shapes - len(tests.free)
    if freedom < 2:
        return None
    measured = tests.measured / tests.deviation

    def linear(shape_values: Any, slacks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The moduli (count,) in MPa that fit best by linear least squares, and the residuals (rows,), relative to the
        noise, for given shape parameters and for given slacks (c,) of the curves: the strains at which the specimens
        become taut."""
        columns = tests.columns(candidate, shape_values, slacks)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        if candidate.positive:
            moduli = nnls(columns / scale, measured)[0] / scale
        else:
            moduli = np.linalg.lstsq(columns / scale, measured, rcond=None)[0] / scale
        return moduli, columns @ moduli - measured

    def all_slacks(free: np.ndarray) -> np.ndarray:
        slacks = tests.slacks.copy()
        slacks[tests.free] = free
        return slacks

    def residuals(x: np.ndarray) -> np.ndarray:
        return linear(x[:shapes], all_slacks(x[shapes:]))[1]

    # Moduli are found by linear least squares for each value of the other unknowns (variable projection).
    ranked = sorted(candidate.starts, key=lambda start: float(np.square(linear(start, tests.slacks)[1]).sum()))
    low = np.array([*[candidate.bounds[0]] * shapes, *[-0.2] * len(tests.free)])
    high = np.array([*[candidate.bounds[1]] * shapes, *[0.3] * len(tests.free)])
    best, least = np.array([*ranked[0], *tests.slacks[tests.free]]), np.inf
    if len(best):
        for start in ranked[:BEST_STARTS]:
            solution = least_squares(
                residuals,
                np.array([*start, *tests.slacks[tests.free]]),
                bounds=(low, high),
                x_scale=np.array([*np.maximum(np.abs(start), 1.0), *[0.01] * len(tests.free)]),
                max_nfev=60,
            )
            if solution.cost < least:
                best, least = solution.x, solution.cost
    moduli, residual = linear(best[:shapes], all_slacks(best[shapes:]))

    # Covariance by the Jacobian of all unknowns; it is increased if neighbouring residuals are correlated.
    unknowns = np.concatenate([moduli, best])

    def model(x: np.ndarray) -> np.ndarray:
        return tests.columns(candidate, x[count : count + shapes], all_slacks(x[count + shapes :])) @ x[:count]

    jacobian = np.empty((rows, len(unknowns)))
    jacobian[:, :count] = tests.columns(candidate, best[:shapes], all_slacks(best[shapes:]))
    for k in range(count, len(unknowns)):
        step = np.zeros(len(unknowns))
        step[k] = STEP * max(1.0, abs(unknowns[k]))
        jacobian[:, k] = (model(unknowns + step) - model(unknowns - step)) / (2 * step[k])
    norms = np.linalg.norm(jacobian, axis=0)
    determined = norms * np.maximum(np.abs(unknowns), 1e-6) > 1e-6 * np.linalg.norm(measured)
    scale = np.where(determined, norms, 1.0)
    left, singular, right = np.linalg.svd(np.where(determined, jacobian / scale, 0.0), full_matrices=False)
    kept = singular > 1e-8 * singular[0]
    variance = float(residual @ residual) / freedom
    root = right.T * np.where(kept, 1 / np.where(kept, singular, 1), 0) / scale[:, None]
    covariance = variance * _correlation_factor(residual, tests.ends) * (root @ root.T)
    leverage = np.minimum(np.square(left[:, kept]).sum(axis=1), 0.99)
    predicted = residual / (1 - leverage)
    # For noise that differs from the assumed noise: HC3 of MacKinnon and White (1985), if it is larger.
    robust = np.square(root @ (left.T * predicted)).sum(axis=1)
    wider = np.sqrt(np.maximum(robust / np.maximum(np.diag(covariance), 1e-300), 1.0))
    covariance = covariance * np.outer(wider, wider)
    unknown = ~determined | (np.abs(right[~kept]) > 0.1).any(axis=0)
    covariance[unknown] = covariance[:, unknown] = 0.0
    covariance[unknown, unknown] = np.inf

    # Results, in MPa and relative to the largest stress of each curve.
    own = count + shapes
    slack_errors = np.zeros(len(tests.curves))
    slack_errors[tests.free] = np.sqrt(np.diag(covariance))[own:]
    constants, covariance = unknowns[:own], covariance[:own, :own]
    width = float(stdtrit(freedom, 0.5 + 0.5 * PROBABILITY)) * np.sqrt(np.diag(covariance))
    relative = tests.deviation / tests.largest
    material, stable, refusal = (None, 1.0, "") if constants_only else _law(candidate, constants)
    return LawFit(
        candidate=candidate,
        constants=constants,
        covariance=covariance,
        low=constants - width,
        high=constants + width,
        slacks=all_slacks(best[shapes:]),
        slack_errors=slack_errors,
        stress=np.split(model(unknowns) * tests.deviation, tests.ends),
        misfit=float(np.sqrt(variance)),
        rms=float(np.sqrt(np.square(residual * relative).mean())),
        predicted=predicted,
        cross_validated=float(np.sqrt(np.square(predicted * relative).mean())),
        material=material,
        stable=stable,
        refusal=refusal,
        possible_slacks=np.zeros((2, len(tests.curves))),
    )


def _correlation_factor(residual: np.ndarray, ends: np.ndarray) -> float:
    """Factor on the covariance for correlated neighbouring residuals: (1 + r) / (1 - r), at least 1."""
    parts = np.split(residual, ends)
    total = sum(float(part @ part) for part in parts)
    correlation = sum(float(part[1:] @ part[:-1]) for part in parts) / total if total else 0.0
    if correlation < 2 / np.sqrt(len(residual)):
        return 1.0
    correlation = min(correlation, 0.95)
    return (1 + correlation) / (1 - correlation)


def _law(candidate: Candidate, constants: np.ndarray) -> tuple[Material | None, float, str]:
    """Create the law with fitted constants. Also returns the stretch up to which it is stable, and the reason if it is
    refused."""
    named = dict(zip(candidate.names, constants.tolist(), strict=True))
    try:
        material = candidate.build(named)
    except InputError as error:
        return None, 1.0, str(error)
    return material, stable_stretch(material), ""
