"""Varied parameters of a study: ranges, lists and files of values; their products, or values taken row by row."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from itertools import product
from math import isfinite, prod
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers, table_of, word_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text import read_text
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.sensing.reading.results import RESULTS

MOST_CHECKED = 5
"""Number of scenes along a smooth curve at which the effect of the mechanics' error is computed."""
MOST_JOBS = 100_000
"""Largest number of scenes in a study; more are refused as a likely mistake."""
STEP = "step"
"""Dimension of values taken together, row by row."""
TAKEN = frozenset(
    "step taxel replicate stage parameter derivative_unit replicate_power seconds responsivity taxel_x taxel_y mesh "
    "map voltage voltage_error counts noise saturated".split()
).union(result.name for result in RESULTS)
"""Names of dimensions and variables of the results, which no varied parameter may have."""


class Axis(NamedTuple):
    """One dimension of a study: the values of a varied parameter, or of several parameters varied together.

    Attributes
    ----------
    dim : str
        Name of the dimension: the name of its parameter, or ``step``.
    values : dict[str, list[str]]
        Values as text by parameter, one for each index along the dimension.
    is_open : bool
        Whether ``values`` are the two ends of a range, between which steps are chosen later.
    is_force : bool
        Whether its parameter is a component of the force.
    is_load : bool
        Whether it is a component of the force or displacement, or the pressure.
    """

    dim: str
    values: dict[str, list[str]]
    is_open: bool = False
    is_force: bool = False
    is_load: bool = False

    @property
    def size(self) -> int:
        """Length of the dimension: the number of its values."""
        return len(next(iter(self.values.values())))


def make_axes(
    vary: Mapping[str, str | Iterable[object]],
    together: Mapping[str, str | Iterable[object]] | None = None,
    folder: Path = Path(),
    forces: Collection[str] = FORCES,
    loads: Collection[str] = (),
) -> tuple[Axis, ...]:
    """Create the dimensions of a study from its varied parameters.

    Parameters
    ----------
    vary : Mapping[str, str or Iterable[object]]
        Values by parameter; each parameter is one dimension.
    together : Mapping[str, str or Iterable[object]], optional
        Values by parameter, of equal lengths. These parameters change together along one further dimension.
    folder : Path
        Folder to which the paths of files with values are relative.
    forces : Collection[str], optional
        Names of the parameters that are components of the force.
    loads : Collection[str], optional
        Names of the parameters that are components of a displacement or a pressure.

    Returns
    -------
    tuple[Axis, ...]
        The dimensions, in the order of ``vary``; the dimension of ``together`` is last.

    Raises
    ------
    InputError
        if nothing is varied, a parameter is varied twice, values are not allowed, or there are too many scenes.
    """
    # One dimension for each parameter that is varied alone.
    vary, together = table_of("vary", vary, "values"), table_of("together", together, "values")
    rows = {name: parse_values(name, values, folder) for name, values in together.items()}
    axes = [
        _axis(name, values, folder, name in forces, name in forces or name in loads) for name, values in vary.items()
    ]

    # One further dimension for all parameters that are taken together.
    lengths = {name: len(words) for name, words in rows.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        raise InputError(f"values taken together must be of equal number, but {shown}.")
    for name in rows:
        if name in vary:
            raise InputError(f"{name} is varied twice, alone and together with others: take one of them out.")
    if rows:
        axes.append(Axis(STEP, rows))

    # Limits of the whole study.
    for name in (*vary, *rows):
        if name in TAKEN:
            raise InputError(
                f"{name} cannot be varied, because a column of the results has the same name: rename the parameter."
            )
    if not axes:
        raise InputError("nothing is varied: values of at least one parameter are needed, by vary, together or steps.")
    count = prod(axis.size for axis in axes)
    if count > MOST_JOBS:
        raise InputError(f"the study holds {count} scenes: at most {MOST_JOBS} are allowed.")
    return tuple(axes)


def _axis(name: str, values: str | Iterable[object], folder: Path, is_force: bool, is_load: bool) -> Axis:
    """Make the dimension of one parameter from its values; for a load, the values may be a range ``start:stop`` without
    a step."""
    if not (isinstance(values, str) and is_load and values.count(":") == 1 and not values.startswith("@")):
        return Axis(name, {name: _distinct(name, parse_values(name, values, folder))}, False, is_force, is_load)
    start, _, stop = values.partition(":")
    ends = [start.strip(), stop.strip()]
    if as_numbers(ends) is None or float(start) == float(stop):
        raise InputError(f"{name} = {values!r} is not a range: start:stop, two different numbers, is needed.")
    return Axis(name, {name: ends}, True, is_force, is_load)


def parse_values(name: str, values: str | Iterable[object], folder: Path = Path()) -> list[str]:
    """Parse the values of one varied parameter; they are returned as text, as a scene takes them.

    Parameters
    ----------
    name : str
        The parameter, for error messages.
    values : str or Iterable[object]
        ``start:stop:step`` (stop included), ``a,b,c``, ``@FILE`` with one value per line, or a list of values.
    folder : Path
        Folder to which a file's path is relative.

    Raises
    ------
    InputError
        if a range is empty, endless, or does not end at its stop; if a file cannot be read, or a value is missing.
    """
    if not isinstance(values, str):
        alone = not isinstance(values, Iterable) or (isinstance(values, np.ndarray) and values.ndim == 0)
        words = [word_of(value) for value in ([values] if alone else values)]
    elif values.startswith("@"):
        words = _lines(name, folder / values[1:])
    else:
        words = _range(name, values) if ":" in values else [word.strip() for word in values.split(",")]
    if not words or not all(words):
        raise InputError(f"{name} = {values!r}: at least one value, and none of them blank, is needed.")
    return words


def _lines(name: str, file: Path) -> list[str]:
    """The lines of a file without comments, which begin with #."""
    lines = read_text(f"{name} = '@{file}'", file, "a file with a value per line").splitlines()
    return [word for line in lines if (word := line.split("#")[0].strip())]


def _distinct(name: str, words: list[str]) -> list[str]:
    """Check that values given as text are distinct, as numbers if all are numbers; they are returned unchanged."""
    if len(set(as_numbers(words) or words)) < len(words):
        raise InputError(f"{name} = {','.join(words)!r} holds a value twice: distinct values are needed.")
    return words


def combinations(axes: Sequence[Axis]) -> Iterator[tuple[tuple[int, ...], dict[str, str]]]:
    """All combinations of values, the last dimension varying fastest.

    Yields
    ------
    index : tuple[int, ...]
        Index along each dimension.
    values : dict[str, str]
        Value as text by varied parameter.
    """
    for index in product(*(range(axis.size) for axis in axes)):
        positions = zip(axes, index, strict=True)
        yield index, {name: words[i] for axis, i in positions for name, words in axis.values.items()}


def _range(name: str, text: str) -> list[str]:
    """The values of a range ``start:stop:step``, stop included, in exact decimal arithmetic."""
    try:
        start, stop, step = (Decimal(word) for word in text.split(":"))
    except (ValueError, InvalidOperation):
        raise InputError(
            f"{name} = {text!r} is not a range: start:stop:step, three numbers, is needed (for a component of the "
            "force or displacement, or a pressure, start:stop)."
        ) from None
    if not all(map(_is_in_range, (start, stop, step))):
        raise InputError(f"{name} = {text!r} is not allowed: finite numbers, none too close to 0, are needed.")
    if step == 0:
        raise InputError(f"{name} = {text!r} is endless: a step other than 0 is needed.")
    steps = (stop - start) / step
    if steps < 0:
        raise InputError(f"{name} = {text!r} is empty: its step leads away from {stop}; change its sign.")
    if steps >= MOST_JOBS:
        raise InputError(f"{name} = {text!r} holds {steps + 1:.3g} values: at most {MOST_JOBS} are allowed.")
    if steps != int(steps):
        raise InputError(
            f"{name} = {text!r}: steps of {step} from {start} do not reach the stop {stop}, which is "
            f"included: choose a step that does."
        )
    return [f"{start + i * step:f}" for i in range(int(steps) + 1)]


def _is_in_range(number: Decimal) -> bool:
    """Whether a number neither overflows nor underflows in double precision."""
    return number.is_finite() and isfinite(float(number)) and (number == 0 or float(number) != 0)


def curve_dimension(axes: Sequence[Axis]) -> str:
    """Name of the dimension along which readings are plotted as curves.

    Of the dimensions with several values, the first of these kinds is chosen: load steps or a force, another load, a
    numeric parameter. If there is none, it is the first dimension.
    """
    longer = [axis for axis in axes if axis.size > 1]
    forces = [axis.dim for axis in longer if axis.dim == STEP or axis.is_force]
    loads = [axis.dim for axis in longer if axis.is_load]
    numeric = [axis.dim for axis in longer if as_numbers(next(iter(axis.values.values())))]
    return next(iter([*forces, *loads, *numeric]), axes[0].dim)


def sides_along(axis: Axis) -> list[dict[str, int]]:
    """For each value along a dimension, the side on which the other values lie; derivatives at the ends are one-sided.

    Returns
    -------
    list[dict[str, int]]
        For each index along the dimension, by numeric parameter: 1 if all other values are larger, -1 if all are
        smaller, 0 if there are values on both sides.
    """
    sides: list[dict[str, int]] = [{} for _ in range(axis.size)]
    for name, words in axis.values.items():
        if numbers := as_numbers(words):
            least, largest = min(numbers), max(numbers)
            for side, number in zip(sides, numbers, strict=True):
                side[name] = (number == least) - (number == largest)
    return sides


def checked_places(axis: Axis) -> set[int]:
    """Indices along a dimension at which the effect of the finite elements on readings is computed. At all other
    indices it is interpolated.

    The effect changes slowly along a smooth curve, so `MOST_CHECKED` evenly spread indices are chosen. All indices are
    returned if there are fewer, or if the values are not monotonic.
    """
    steps = [np.diff(numbers) for words in axis.values.values() if (numbers := as_numbers(words))]
    smooth = len(steps) == len(axis.values) and all(np.all(step >= 0) or np.all(step <= 0) for step in steps)
    count = MOST_CHECKED if smooth else axis.size
    return set(np.linspace(0, axis.size - 1, min(count, axis.size)).round().astype(int).tolist())
