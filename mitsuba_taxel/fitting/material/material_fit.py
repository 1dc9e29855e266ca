"""Material laws fitted to tests of a silicone, ranked by their prediction errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.candidates import CANDIDATES, Candidate
from mitsuba_taxel.fitting.material.curves import LEAST_ROWS, StressCurve, read_curve
from mitsuba_taxel.fitting.material.law_fit import LawFit, Tests, fit_law
from mitsuba_taxel.fitting.material.noise import CurveNoise, curve_noise, refuse_contradictions
from mitsuba_taxel.fitting.material.plausible import (
    COARSE,
    POOR,
    refuse_contradicting_kinds,
    refuse_percent,
    softer_than_all,
)
from mitsuba_taxel.fitting.material.relaxation import RelaxationFit, fit_relaxation
from mitsuba_taxel.mechanics.materials.laws import Material

if TYPE_CHECKING:
    import pandas

SIGNIFICANT = 2.5
"""Number of standard deviations by which a law with more constants must predict better."""
NEGLIGIBLE = 2e-3
"""Improvement of predictions, relative to the largest stress, that does not justify more constants."""
BEGINS = 0.03
"""Largest first strain of a curve, relative to its largest strain, for which slack can be estimated."""
LEAST_SLACK = 2e-3
CLEAR = 6.0
"""Improvement of the information criterion from which a slack counts as real."""
NEARLY = 1.5
"""Largest residuals of laws that follow the tests nearly as well as the best law, relative to the residuals of that
law."""
OTHER_MODES = 1.5
"""Largest stretch at which laws are compared in modes without tests."""


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """Result of `fit_material`: fitted material laws in the order of their ranks, and the tests.

    Attributes
    ----------
    fits : list[LawFit]
        Fitted laws, the best first. The best is the law with the fewest constants, unless another law predicts clearly
        better. The other laws follow in the order of their cross-validated errors; refused laws are last.
    curves : list[StressCurve]
        Tests.
    noises : list[CurveNoise]
        Noise of each test.
    relaxation : RelaxationFit or None
        Prony series.
    warnings, notes : list[str]
        Reasons to doubt the result; notes on omitted or converted rows.
    """

    fits: list[LawFit]
    curves: list[StressCurve]
    noises: list[CurveNoise]
    relaxation: RelaxationFit | None
    warnings: list[str]
    notes: list[str]

    @property
    def best(self) -> LawFit:
        """The law that ranks first."""
        return self.fits[0]

    @property
    def largest_stretch(self) -> float:
        """Largest principal stretch of the tests."""
        return max(curve.largest_stretch for curve in self.curves)

    @property
    def ranking(self) -> pandas.DataFrame:
        """One row per law: number of constants, errors, and the stretch up to which it is stable."""
        import pandas

        rows = [
            {
                "law": fit.candidate.label,
                "constants": len(fit.candidate.names),
                "cross_validated_error": fit.cross_validated,
                "rms": fit.rms,
                "misfit": fit.misfit,
                "stable_stretch": fit.stable,
                "refusal": fit.refusal,
            }
            for fit in self.fits
        ]
        return pandas.DataFrame(rows)


def fit_material(
    uniaxial: Sequence[str | Path] = (),
    *,
    compression: Sequence[str | Path] = (),
    planar: Sequence[str | Path] = (),
    equibiaxial: Sequence[str | Path] = (),
    relaxation: str | Path | None = None,
    area: float | None = None,
    length: float | None = None,
    true_stress: bool = False,
    up_to: float | None = None,
    law: str | None = None,
) -> MaterialFit:
    """Fit hyperelastic laws to tests of a silicone, and rank them by their cross-validated errors.

    Parameters
    ----------
    uniaxial : sequence of str or Path
        Tables of uniaxial tests; compression is negative.
    compression : sequence of str or Path
        Tables of uniaxial tests that count compression as positive.
    planar, equibiaxial : sequence of str or Path
        Tables of planar (pure shear) and equibiaxial tests.
    relaxation : str or Path, optional
        Table of stress over time at a constant strain.
    area, length : float, optional
        Undeformed cross-section in mm² for forces, and length in mm for extensions.
    true_stress : bool
        Whether stresses are per deformed area.
    up_to : float, optional
        Largest nominal strain that the fit uses, such as that of the pad.
    law : str, optional
        Name of the only law to be fitted, such as ``"yeoh"``; by default all laws are.

    Returns
    -------
    MaterialFit
        Laws with their constants, intervals and errors.

    Raises
    ------
    InputError
        if a table is refused, tests contradict each other, or the law is not one of those that can be fitted.
    """
    candidates = tuple(candidate for candidate in CANDIDATES if law in (None, candidate.law))
    if not candidates:
        allowed = ", ".join(sorted({candidate.law for candidate in CANDIDATES}))
        raise InputError(f"law = {law!r} cannot be fitted: one of {allowed} is needed.")
    given = [(file, "uniaxial", False) for file in uniaxial]
    given += [(file, "uniaxial", True) for file in compression]
    given += [(file, "planar", False) for file in planar] + [(file, "equibiaxial", False) for file in equibiaxial]
    if not given:
        raise InputError("no test is given: a table of a uniaxial, planar or equibiaxial test is needed.")
    curves = [
        read_curve(file, mode, compression=positive, area=area, length=length, true_stress=true_stress)
        for file, mode, positive in given
    ]
    if up_to is not None:
        if not (is_number(up_to) and up_to > 0):
            raise InputError(f"up_to = {up_to!r} is not allowed: a nominal strain above 0 is needed.")
        curves = [_up_to(curve, up_to) for curve in curves]
    return rank_laws(curves, None if relaxation is None else fit_relaxation(relaxation), candidates)


def fit_class(law: type[Material], uniaxial: Sequence[str | Path] = (), **tests: Any) -> MaterialFit:
    """Fit the laws of a class: all laws for `Material`, else the one law; see `Material.fit`.

    Parameters
    ----------
    law : type[Material]
        `Material`, or the class of a law.
    uniaxial : sequence of str or Path
        Tables of uniaxial tests.
    **tests : Any
        Other tests and settings of `fit_material`.

    Returns
    -------
    MaterialFit
        Laws with their constants, intervals and errors.

    Raises
    ------
    InputError
        as `fit_material`.
    """
    own = vars(law).get("name", law.__name__)  # a subclass of a law inherits its name, but is another law
    return fit_material(uniaxial, law=None if law is Material else own, **tests)


def rank_laws(
    curves: list[StressCurve],
    relaxation: RelaxationFit | None = None,
    candidates: Sequence[Candidate] = CANDIDATES,
) -> MaterialFit:
    """Fit hyperelastic laws to the loading branches of tests, and rank them; see `fit_material`.

    Parameters
    ----------
    curves : list[StressCurve]
        Loading branches.
    relaxation : RelaxationFit, optional
        Prony series of the same silicone.
    candidates : sequence of Candidate
        Laws to be fitted. Slack is estimated by all laws.

    Returns
    -------
    MaterialFit
        Laws with their constants, intervals and errors.

    Raises
    ------
    InputError
        if tests contradict each other, have too few rows, or have strains that seem to be in percent.
    """
    noises = [curve_noise(curve) for curve in curves]
    warnings = refuse_contradictions(curves, noises)
    possible = [
        LEAST_SLACK if np.abs(curve.strain).min() <= BEGINS * np.abs(curve.strain).max() else 0.0 for curve in curves
    ]
    with_slacks = Tests(curves, [noise._replace(slack=s) for noise, s in zip(noises, possible, strict=True)])
    tests = Tests(curves, noises := _with_slacks(curves, noises, with_slacks))
    fits = [fit for fit in (fit_law(candidate, tests) for candidate in candidates) if fit is not None]
    if not fits:
        raise InputError(f"{len(tests.measured)} rows of tests are not enough for this law: add tests.")
    if len(with_slacks.free) > len(tests.free):
        fits = [_with_unknown_slacks(fit, with_slacks) for fit in fits]
    reach = max(curve.largest_stretch for curve in curves)
    fits = _ranked([_refused_where_unstable(fit, reach) for fit in fits])
    if len(candidates) == len(CANDIDATES):
        refuse_percent(curves, fits[0])
    if fits[0].refusal:
        raise InputError(f"no law follows the tests: {fits[0].candidate.label} is refused, as {fits[0].refusal}")

    best = fits[0]
    if len(candidates) == len(CANDIDATES):
        refuse_contradicting_kinds(curves, noises, best)

    # Doubts and notes.
    warnings += softer_than_all(curves, best)
    if best.misfit > POOR:
        row = int(np.argmax(np.abs(best.predicted)))
        index = int(np.searchsorted(tests.ends, row, side="right"))
        line = np.concatenate([curve.lines for curve in curves])[row]
        warnings.append(
            f"no law follows the tests within their noise (residuals {best.misfit:.1f} times as large, worst in "
            f"{curves[index].file!r}, line {line}): tests of other specimens, modes that contradict each other, or slip"
        )
    if best.rms > COARSE:
        warnings.append(f"the best law misses the tests by {best.rms:.0%} of the largest stress: check the tables")
    modes = {curve.mode for curve in curves}
    if len(modes) == 1:
        (mode,) = modes
        spread = _spread_in_other_modes(fits, mode, min(reach, OTHER_MODES))
        words = f"by {spread:.0%}" if spread < 1 else "by more than 100%"
        warnings.append(
            f"only {mode} tests: laws that follow them nearly as well differ {words} in other modes at a stretch of "
            f"{min(reach, OTHER_MODES):.3g}"
        )
    notes = [note for curve in curves for note in curve.notes]
    for curve, slack, may, (low, high) in zip(curves, best.slacks, possible, best.possible_slacks.T, strict=True):
        if slack:
            words = "of slack is subtracted" if slack > 0 else "of preload is added"
            notes.append(f"{curve.file}: the curve does not start at the origin: a strain of {abs(slack):.4f} {words}")
        elif may and max(-low, high) > LEAST_SLACK:
            notes.append(
                f"{curve.file}: no slack is subtracted; the test does not exclude a slack of {low:.2g} to {high:.2g} "
                "strain, which the intervals include"
            )
        elif not may:
            first = np.abs(curve.strain).min()
            notes.append(f"{curve.file}: slack up to its first strain, {first:.3g}, is unknown; intervals leave it out")
    return MaterialFit(fits, curves, noises, relaxation, warnings, notes + (relaxation.notes if relaxation else []))


def _with_slacks(curves: list[StressCurve], noises: list[CurveNoise], with_slacks: Tests) -> list[CurveNoise]:
    """Noise of test curves. It includes an estimate of the slack of each specimen if this makes the simple laws much
    more likely.
    """
    if not len(with_slacks.free):
        return noises

    def score(tests: Tests) -> tuple[float, LawFit]:
        """Bayesian information criterion of the best simple law, and its fit."""
        simple = [candidate for candidate in CANDIDATES if len(candidate.names) <= 3]
        found = (fit_law(candidate, tests, constants_only=True) for candidate in simple)
        fits = [fit for fit in found if fit is not None]
        rows, free = len(tests.measured), len(tests.free)
        unknowns = [len(fit.candidate.names) + free for fit in fits]
        scores = [
            rows * np.log(fit.misfit**2 * (rows - count) / rows) + count * np.log(rows)
            for fit, count in zip(fits, unknowns, strict=True)
        ]
        best = int(np.argmin(scores))
        return float(scores[best]), fits[best]

    without, (free, fit) = score(Tests(curves, noises))[0], score(with_slacks)
    if free > without - CLEAR:
        return noises
    found = np.abs(fit.slacks) > np.maximum(LEAST_SLACK, 3 * fit.slack_errors)
    values = np.where(found, fit.slacks, 0.0).tolist()
    return [curve_noise(curve, value) for curve, value in zip(curves, values, strict=True)]


def _with_unknown_slacks(fit: LawFit, with_slacks: Tests) -> LawFit:
    """The fit with intervals that include the intervals of a fit in which all slacks are unknown."""
    candidate = fit.candidate
    shapes = tuple(fit.constants[len(candidate.moduli) :].tolist())
    wider = fit_law(replace(candidate, starts=(shapes,)), with_slacks, constants_only=True)
    if wider is None:  # too few rows
        infinite = np.full(len(fit.constants), np.inf)
        return replace(fit, covariance=np.diag(infinite), low=-infinite, high=infinite)
    return replace(
        fit,
        covariance=wider.covariance,
        low=np.minimum(fit.low, wider.low),
        high=np.maximum(fit.high, wider.high),
        possible_slacks=np.stack([wider.slacks - 2 * wider.slack_errors, wider.slacks + 2 * wider.slack_errors]),
    )


def _up_to(curve: StressCurve, strain: float) -> StressCurve:
    """The rows of a curve up to a strain; raises `InputError` if there are too few."""
    inside = np.abs(curve.strain) <= strain
    if inside.sum() < LEAST_ROWS:
        rows = f"{inside.sum()} rows up to a strain of {strain:g}"
        raise InputError(f"test {curve.file!r}: {rows} are not enough: at least {LEAST_ROWS} are needed.")
    if inside.all():
        return curve
    notes = [*curve.notes, f"{curve.file}: {int((~inside).sum())} rows beyond a strain of {strain:g} are left out"]
    return replace(
        curve, lines=curve.lines[inside], strain=curve.strain[inside], stress=curve.stress[inside], notes=notes
    )


def _refused_where_unstable(fit: LawFit, reach: float) -> LawFit:
    if fit.refusal or fit.stable >= reach:
        return fit
    return replace(fit, refusal=f"its stress falls beyond a principal stretch of {fit.stable:.3g}, within the tests")


def _ranked(fits: list[LawFit]) -> list[LawFit]:
    """Laws in the order of `MaterialFit.fits`."""
    allowed = sorted((fit for fit in fits if not fit.refusal), key=lambda fit: fit.cross_validated)
    refused = sorted((fit for fit in fits if fit.refusal), key=lambda fit: fit.cross_validated)
    if not allowed:
        return refused

    def clearly_worse(fit: LawFit, other: LawFit) -> bool:
        gain = fit.predicted**2 - other.predicted**2
        significant = gain.mean() > SIGNIFICANT * gain.std() / np.sqrt(len(gain))
        return significant and fit.cross_validated > other.cross_validated + NEGLIGIBLE

    def quality(fit: LawFit) -> float:
        return float(np.square(fit.predicted).mean())

    leader = min(allowed, key=quality)
    equal = [fit for fit in allowed if not clearly_worse(fit, leader)]
    fewest = min(len(fit.candidate.names) for fit in equal)
    best = min((fit for fit in equal if len(fit.candidate.names) == fewest), key=quality)
    return [best, *sorted((fit for fit in allowed if fit is not best), key=quality), *refused]


def _spread_in_other_modes(fits: list[LawFit], mode: str, stretch: float) -> float:
    """Largest relative difference in stress between all laws that fit as well as the best one, in test modes for which
    there is no test.
    """
    good = [fit for fit in fits if not fit.refusal and fit.misfit < NEARLY * fits[0].misfit]
    at = np.array([stretch])
    others = [other for other in ("uniaxial", "planar", "equibiaxial") if other != mode]
    ratios = [
        fit.candidate.stress(other, at, fit.constants)[0] / fits[0].candidate.stress(other, at, fits[0].constants)[0]
        for other in others
        for fit in good
    ]
    return float(np.abs(np.array(ratios) - 1).max())
