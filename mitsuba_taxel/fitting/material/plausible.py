"""Refusals of tests that no law follows together, although laws follow them alone or with strain in percent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.candidates import CANDIDATES
from mitsuba_taxel.fitting.material.curves import StressCurve
from mitsuba_taxel.fitting.material.law_fit import LawFit, Tests, fit_law
from mitsuba_taxel.fitting.material.noise import CurveNoise, curve_noise, smooth_curve
from mitsuba_taxel.mechanics.materials.silicones import SILICONES

POOR = 3.0
"""Residuals, relative to the noise, above which a warning states that the best law does not follow the tests."""
COARSE = 0.1
"""Residuals, relative to the largest stress, above which a warning states by how much the best law misses the tests."""
FOLLOWED = 1.5
"""Residuals, relative to the noise, below which a law follows the tests with strain in percent."""
MISSED = 0.15
"""Difference of the best law from a test, relative to the stress, that is refused if laws follow each test alone."""
SMALL = 0.1
"""Strain, relative to the largest of a test, below which differences do not count."""
MOST_CONSTANTS = 3
"""Number of constants of the laws that are tried on single tests, at most."""


def refuse_percent(curves: Sequence[StressCurve], best: LawFit) -> None:
    """Refuse strains without a unit that seem to be in percent.

    In percent, the curve of a small strain is nearly straight, as that of a neo-Hookean solid. No law of silicones is
    straight over the same numbers taken as fractions.

    Parameters
    ----------
    curves : sequence of StressCurve
        Loading branches, with strains as fractions.
    best : LawFit
        The best law of these curves.

    Raises
    ------
    InputError
        if no law follows the tests within three times their noise, but a neo-Hookean one does within 1.5 times their
        noise, or three times as well, if the strains without a unit are in percent; the message names the row of the
        largest strain.
    """
    doubtful = [curve for curve in curves if curve.without_unit]
    if not doubtful or best.misfit <= POOR:
        return
    scaled = [replace(curve, strain=curve.strain / 100) if curve.without_unit else curve for curve in curves]
    fit = _best(scaled, [curve_noise(curve) for curve in scaled], most_constants=1)
    if fit is None or (fit.misfit > FOLLOWED and POOR * fit.rms > best.rms):
        return
    curve, row = _largest_strain(doubtful)
    raise InputError(
        f"test {curve.file!r}, line {curve.lines[row]}: a strain of {curve.strain[row]:.4g} seems to be in percent: "
        "the curve is then as straight as it must be, and no law follows it if it is a fraction. The heading "
        "'strain [%]' is needed, or 'strain [1]' for fractions."
    )


def softer_than_all(curves: Sequence[StressCurve], best: LawFit) -> list[str]:
    """Warning about strains without a unit, if the silicone is softer than all named ones.

    Parameters
    ----------
    curves : sequence of StressCurve
        Loading branches, with strains as fractions.
    best : LawFit
        The best law of these curves.

    Returns
    -------
    list[str]
        One sentence, or none.
    """
    doubtful = [curve for curve in curves if curve.without_unit]
    law: Any = best.material
    named: list[Any] = [entry.material for entry in SILICONES.values()]
    softest = min(float(silicone.youngs_modulus) for silicone in named)
    if not doubtful or law is None or law.youngs_modulus >= softest:
        return []
    curve, row = _largest_strain(doubtful)
    return [
        f"test {curve.file!r}, line {curve.lines[row]}: E = {law.youngs_modulus:.2g} MPa is less than that of every "
        f"named silicone ({softest:.2g} MPa): a strain of {curve.strain[row]:.3g} without a unit may be in percent"
    ]


def _largest_strain(curves: Sequence[StressCurve]) -> tuple[StressCurve, int]:
    """The curve with the largest strain, and the index of the row that has it."""
    curve = max(curves, key=lambda curve: float(np.abs(curve.strain).max()))
    return curve, int(np.abs(curve.strain).argmax())


def refuse_contradicting_kinds(curves: Sequence[StressCurve], noises: Sequence[CurveNoise], best: LawFit) -> None:
    """Refuse tests of different kinds, such as tension and compression, that no law follows together.

    Parameters
    ----------
    curves : sequence of StressCurve
        Loading branches.
    noises : sequence of CurveNoise
        Their noise and slack.
    best : LawFit
        The best law of all tests together.

    Raises
    ------
    InputError
        if the best law misses the smooth curve of a test by more than 15 % of its stress at a row and by more than
        three times the noise, but a law follows each test alone to half of that, and no law, stable or not, follows
        all of them so; the message names the row that is missed most.
    """
    if len(curves) < 2 or best.misfit <= POOR:
        return
    misses = [_miss(*each) for each in zip(curves, noises, best.stress, strict=True)]
    index = int(np.argmax([miss.max() for miss in misses]))
    if misses[index].max() <= MISSED:
        return
    each_alone = [([curve], [noise]) for curve, noise in zip(curves, noises, strict=True)]
    if not all(_followed(*each) for each in each_alone) or _followed(curves, noises):
        return
    curve, row = curves[index], int(misses[index].argmax())
    others = ", ".join(repr(other.file) for k, other in enumerate(curves) if k != index)
    raise InputError(
        f"test {curve.file!r}, line {curve.lines[row]}: {curve.stress[row]:.4g} MPa at a strain of "
        f"{curve.strain[row]:.4g}, where the law that is nearest to all tests has {best.stress[index][row]:.4g} MPa: "
        f"no law follows it together with {others}, which their noise does not explain. Tests of one silicone that "
        "agree are needed, or one fit for each."
    )


def _miss(curve: StressCurve, noise: CurveNoise, stress: np.ndarray) -> np.ndarray:
    """Difference (N,) of a law's stress from the smooth curve of a test, relative to the smooth curve; 0 at small
    strains, and where noise explains it."""
    smooth, size = smooth_curve(curve, noise.slack), np.abs(curve.strain)
    difference = np.abs(stress - smooth)
    counts = (size > SMALL * size.max()) & (difference > POOR * noise.deviation)
    return np.where(counts, difference / np.maximum(np.abs(smooth), 1e-300), 0.0)


def _followed(curves: Sequence[StressCurve], noises: Sequence[CurveNoise]) -> bool:
    """Whether a law with few constants, stable or not, follows tests to half of the difference that is refused."""
    fit = _best(curves, noises)
    if fit is None:
        return False
    misses = (_miss(*each) for each in zip(curves, noises, fit.stress, strict=True))
    return max(float(miss.max()) for miss in misses) <= MISSED / 2


def _best(
    curves: Sequence[StressCurve], noises: Sequence[CurveNoise], most_constants: int = MOST_CONSTANTS
) -> LawFit | None:
    """The fit with the smallest residuals of the laws with few constants; None if there are too few rows."""
    tests = Tests(list(curves), list(noises))
    simple = [law for law in CANDIDATES if len(law.names) <= most_constants]
    fits = [fit_law(law, tests, constants_only=True) for law in simple]
    found = [fit for fit in fits if fit is not None]
    return min(found, key=lambda fit: fit.misfit) if found else None
