"""Tables of tests of a silicone: stretch and nominal stress of the loading branch, and checks."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number, path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import UNITS, Column, Table, read_table

MODES = ("uniaxial", "planar", "equibiaxial")
LEAST_ROWS = 5
"""Least number of rows of a loading branch, which exceeds the number of constants of the simplest laws."""
LARGEST_PLAIN_STRAIN = 3.0
"""Largest strain of a column without a unit; larger numbers may be in percent."""
DOUBTFUL_STRAIN = 1.0
"""Largest strain of a column without a unit above which a note says that it is taken as a fraction."""
TURN = 0.04
"""Decrease of strain, relative to its range, with which an unloading branch begins."""
SIGN = 0.05
"""Fraction of the largest stress and strain above which their signs are compared."""
FALL = 0.03
"""Decrease of the stress, relative to the largest stress, that is refused if noise does not explain it."""
SIGMAS = 5.0
_OWN_UNITS = {
    "%": 0.01, "percent": 0.01, "psi": 6.894757293168361e-3, "ksi": 6.894757293168361, "n/mm2": 1.0, "n/mm^2": 1.0,
    "n/mm²": 1.0, "mm/mm": 1.0, "-": 1.0, "1": 1.0,
}  # fmt: skip
"""Factors of units that other tables do not have."""
_BRACKET = re.compile(r"[\[(]([^\])]*)[\])]\s*$")
_STRAIN = re.compile(r"strain|stretch|extension|displacement|elongation", re.IGNORECASE)
_STRESS = re.compile(r"stress|force|load", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class StressCurve:
    """Stress-strain curve of the loading branch of a material test, with N rows.

    Attributes
    ----------
    file : str
        Name of the file.
    mode : str
        One of `MODES`.
    lines : (N,) ndarray
        Line numbers of the rows in the file.
    strain, stress : (N,) ndarray
        Nominal strain and nominal stress in MPa, negative in compression.
    notes : list[str]
        Notes on omitted or converted rows.
    without_unit : bool
        Whether the strain has no unit, so that it may be in percent.
    """

    file: str
    mode: str
    lines: np.ndarray
    strain: np.ndarray
    stress: np.ndarray
    notes: list[str] = field(default_factory=list)
    without_unit: bool = False

    @property
    def largest_stretch(self) -> float:
        """Largest principal stretch; in uniaxial compression, the stretch of the sides."""
        high, low = 1 + float(self.strain.max()), 1 + float(self.strain.min())
        across = {"uniaxial": low**-0.5, "planar": 1 / low, "equibiaxial": low**-2}[self.mode]
        return max(high, across)


def read_curve(
    file: str | Path,
    mode: str,
    *,
    compression: bool = False,
    area: float | None = None,
    length: float | None = None,
    true_stress: bool = False,
) -> StressCurve:
    """Read a material test from a table, and extract the stress-strain curve of its loading branch.

    Parameters
    ----------
    file : str or Path
        Table with a column of strain, stretch or extension, and a column of stress or force. Headings name their units:
        ``strain [%]``, ``extension [mm]``, ``stress [kPa]``, ``force [N]``. Headings with "true" are logarithmic strain
        and true stress.
    mode : str
        One of `MODES`.
    compression : bool
        Whether the test counts compression as positive.
    area : float, optional
        Undeformed cross-section in mm², for forces.
    length : float, optional
        Undeformed length between the marks or clamps in mm, for extensions.
    true_stress : bool
        Whether stresses are forces per deformed area, if the heading does not state it.

    Returns
    -------
    StressCurve
        Loading branch, in nominal strain and stress.

    Raises
    ------
    InputError
        if a column is missing or ambiguous, or if rows cannot be from a test of a silicone; the message names file and
        line.
    """
    path = path_of("test", file)
    for name, value in (("area", area), ("length", length)):
        if value is not None and not (is_number(value) and value > 0):
            raise InputError(f"{name} = {value!r} is not allowed: a number above 0 is needed.")
    what = f"test {path.name!r}"
    table = read_table(what, path)
    strain_column, stress_column = (_column(table, pattern) for pattern in (_STRAIN, _STRESS))
    strain = _strains(table, strain_column, length)
    stress, is_force = _stresses(table, stress_column, area)
    lines = np.array(table.lines)
    if compression:
        strain, stress = -strain, -stress
    if len(lines) < LEAST_ROWS:
        rows = f"line {lines[0]} alone is" if len(lines) == 1 else f"{len(lines)} rows are"
        raise InputError(f"{what}: {rows} not enough: at least {LEAST_ROWS} rows of the loading branch are needed.")
    if np.any(strain <= -1):
        line = lines[np.argmax(strain <= -1)]
        raise InputError(
            f"{what}, line {line}: a strain of {strain[lines == line][0]:g} is not allowed: above -1 is needed; strain "
            "in percent needs the heading 'strain [%]'."
        )
    if (true_stress or "true" in stress_column.heading.lower()) and not is_force:
        stress = stress / (1 + strain)
    _refuse_signs(what, lines, strain, stress, compression)
    branch, notes = _loading_branch(strain, path.name)
    without_unit = "stretch" not in strain_column.heading.lower() and _unit_of(table, strain_column) == ("", None)
    without_unit &= length is None
    if without_unit and np.abs(strain).max() > DOUBTFUL_STRAIN:
        notes.append(f"{path.name}: {strain_column.heading} has no unit and is taken as a fraction, not in percent")
    curve = StressCurve(path.name, mode, lines[branch], strain[branch], stress[branch], notes, without_unit)
    if len(curve.lines) < LEAST_ROWS:
        raise InputError(
            f"{what}: its loading branch has {len(curve.lines)} rows (from line {curve.lines[0]}): at least "
            f"{LEAST_ROWS} are needed."
        )
    _refuse_fall(what, curve)
    return curve


def _column(table: Table, pattern: re.Pattern[str]) -> Column:
    """The column whose heading contains one of the words; engineering values are preferred to true values."""
    found = [column for column in table.columns if pattern.search(column.heading)]
    nominal = [column for column in found if "true" not in column.heading.lower()]
    found = nominal or found
    if len(found) != 1:
        words = pattern.pattern.replace("|", ", ")
        problem = f"columns {', '.join(column.heading for column in found)} are" if found else "no column is"
        raise InputError(f"{table.what}: {problem} not allowed: one column is needed whose heading has one of {words}.")
    return found[0]


def _unit_of(table: Table, column: Column) -> tuple[str, float | None]:
    """Kind of the unit of a column (`MPa`, `N`, `mm`, or empty), and its factor; None without a unit.

    Raises `InputError` for an unknown unit in brackets.
    """
    bracket = _BRACKET.search(column.heading)
    word = (bracket[1] if bracket else column.heading.replace("_", " ").split()[-1]).strip().lower()
    if word in _OWN_UNITS:
        return ("MPa" if word in ("psi", "ksi") or word.startswith("n/") else "", _OWN_UNITS[word])
    if column.unit:
        kind, factor = UNITS[column.unit]
        return kind, float(factor)
    if bracket:
        raise InputError(
            f"{table.what}, column {column.heading}: the unit {bracket[1]!r} is not known: %, mm, N, MPa, kPa or psi, "
            "for example, is needed."
        )
    return "", None


def _strains(table: Table, column: Column, length: float | None) -> np.ndarray:
    """Nominal strains of a column of strain, stretch or extension."""
    values, (kind, factor) = table.numbers(column), _unit_of(table, column)
    heading = column.heading.lower()
    if kind == "mm" or (factor is None and re.search("extension|displacement", heading)):
        if length is None:
            raise InputError(
                f"{table.what}, column {column.heading}: the length of the specimen in mm is needed (`--length`)."
            )
        return values * (1.0 if factor is None else factor) / length
    if kind:
        raise InputError(f"{table.what}, column {column.heading}: a strain, or an extension in mm, is needed.")
    if "stretch" in heading:
        if np.any(values <= 0):
            line = table.lines[int(np.argmax(values <= 0))]
            raise InputError(f"{table.what}, line {line}: a stretch of 0 or less is not allowed: above 0 is needed.")
        return values - 1
    if factor is None and np.abs(values).max(initial=0) > LARGEST_PLAIN_STRAIN:
        row = int(np.argmax(np.abs(values) > LARGEST_PLAIN_STRAIN))
        raise InputError(
            f"{table.what}, line {table.lines[row]}: a strain of {values[row]:g} may be in percent: the heading "
            "'strain [%]' is needed, or 'strain [1]' for fractions."
        )
    values = values * (1.0 if factor is None else factor)
    return np.expm1(values) if "true" in heading or "log" in heading else values


def _stresses(table: Table, column: Column, area: float | None) -> tuple[np.ndarray, bool]:
    """Stresses in MPa of a column of stress or force, and whether it is a force."""
    values, (kind, factor) = table.numbers(column), _unit_of(table, column)
    if kind == "N":
        if area is None:
            raise InputError(
                f"{table.what}, column {column.heading}: the area of the specimen in mm² is needed (`--area`)."
            )
        return values * float(factor or 1) / area, True
    if kind != "MPa":
        raise InputError(
            f"{table.what}, column {column.heading}: a unit is needed: 'stress [MPa]', [kPa] or [psi], or 'force [N]'."
        )
    return values * float(factor or 1), False


def _refuse_signs(what: str, lines: np.ndarray, strain: np.ndarray, stress: np.ndarray, compression: bool) -> None:
    """Refuse a stress whose sign is opposite to the sign of its strain."""
    opposite = (strain * stress < 0) & (np.abs(strain) > SIGN * np.abs(strain).max())
    opposite &= np.abs(stress) > SIGN * np.abs(stress).max()
    if opposite.any():
        row = int(np.argmax(opposite))
        remedy = "" if compression else "; a test that counts compression as positive is given as compression"
        raise InputError(
            f"{what}, line {lines[row]}: a stress of {stress[row]:.4g} MPa at a strain of {strain[row]:.4g} has the "
            f"wrong sign: positive in tension, negative in compression, is needed{remedy}."
        )


def _loading_branch(strain: np.ndarray, name: str) -> tuple[np.ndarray, list[str]]:
    """Indices of the rows of the first loading, sorted by strain, and notes on omitted rows."""
    size = np.abs(strain)
    threshold = TURN * float(size.max())
    highest = np.maximum.accumulate(size)
    turned = np.flatnonzero(highest - size > threshold)
    if not len(turned):
        return np.argsort(size, kind="stable"), []
    # The first loading ends at the highest strain before the first turn; later rows with higher strains are part of the
    # loading, too.
    end = int(np.argmax(size[: turned[0] + 1]))
    beyond = np.flatnonzero(size > size[end])
    rows = np.concatenate([np.arange(end + 1), beyond[beyond > end]])
    later = rows[end + 1 :]
    rows = np.concatenate([rows[: end + 1], later[np.maximum.accumulate(size[later]) <= size[later]]])
    left_out = len(strain) - len(rows)
    note = f"{name}: {left_out} rows of unloading and reloading are left out"
    return rows[np.argsort(size[rows], kind="stable")], [note]


def _refuse_fall(what: str, curve: StressCurve) -> None:
    """Refuse stress that decreases by more than its noise while strain increases."""
    size, strain = np.abs(curve.stress), np.abs(curve.strain)
    order = np.argsort(strain, kind="stable")
    size, lines = size[order], curve.lines[order]
    width = max(1, len(size) // 10)
    means = np.convolve(size, np.ones(width) / width, mode="valid")
    bends = np.abs(size[2:] - 2 * size[1:-1] + size[:-2]) / math.sqrt(6)
    relative = float(np.median(bends / np.maximum(size[1:-1], 1e-300)))
    noise = max(float(np.median(bends)), relative * float(size.max())) / 0.6745
    fall = np.maximum.accumulate(means) - means
    worst = int(np.argmax(fall))
    half = len(size) // 2
    if size[-half:].mean() < size[:half].mean():
        raise InputError(
            f"{what}, line {lines[0]} to {lines[-1]}: the stress is lower in the second half of the strains than in "
            "the first: a rising curve is needed."
        )
    if fall[worst] > FALL * size.max() and fall[worst] > SIGMAS * noise * math.sqrt(2 / width):
        begin = int(np.argmax(means[: worst + 1]))
        first = min(begin + width, len(lines) - 1)
        raise InputError(
            f"{what}, line {lines[first]}: the stress falls from {means[begin]:.4g} to {means[worst]:.4g} MPa while "
            "the strain grows: a rising curve is needed; leave out rows after a slip or a rupture."
        )


def describe(curve: StressCurve) -> dict[str, Any]:
    """File, mode, rows and range of a curve, for results."""
    strain = [float(f"{value:.6g}") + 0.0 for value in (curve.strain.min(), curve.strain.max())]
    return {"file": curve.file, "mode": curve.mode, "rows": len(curve.lines), "strain": strain}
