"""What a study varies: ranges and lists of parameter values, and their product."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal, InvalidOperation
from itertools import product
from math import isfinite, prod

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.studies.units import FORCES

MOST_JOBS = 100_000
"""More scenes than this in one study are taken for a slip."""


def parse_values(name: str, values: str | Iterable[object]) -> list[str]:
    """The values of one varied parameter, as the words that the scene gets.

    Parameters
    ----------
    name : the parameter, for error messages
    values : ``start:stop:step`` (stop included), ``a,b,c``, or the values themselves

    Raises
    ------
    InputError
        if the range is empty, endless, or does not end at its stop; if a value is missing or comes twice.
    """
    if isinstance(values, str):
        words = _range(name, values) if ":" in values else [word.strip() for word in values.split(",")]
    else:
        words = [str(value) for value in values]
    if not words or not all(words):
        raise InputError(f"{name} = {values!r}: at least one value, and none of them blank, is needed.")
    if len(set(as_numbers(words) or words)) < len(words):
        raise InputError(f"{name} = {values!r} holds a value twice.")
    return words


def as_numbers(words: list[str]) -> list[float] | None:
    """The values as numbers, or None where one of them is no finite number."""
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if all(map(isfinite, numbers)) else None


def combinations(varied: Mapping[str, list[str]]) -> Iterator[tuple[tuple[int, ...], dict[str, str]]]:
    """Every combination of values: its index along each parameter, and its values; the last runs fastest.

    Raises
    ------
    InputError
        if there are more than :data:`MOST_JOBS`.
    """
    count = prod(len(values) for values in varied.values())
    if count > MOST_JOBS:
        raise InputError(f"the study holds {count} scenes: at most {MOST_JOBS} are allowed.")
    for index in product(*(range(len(values)) for values in varied.values())):
        yield index, {name: values[i] for (name, values), i in zip(varied.items(), index, strict=True)}


def _range(name: str, text: str) -> list[str]:
    try:
        start, stop, step = (Decimal(part) for part in text.split(":"))
    except (ValueError, InvalidOperation):
        raise InputError(f"{name} = {text!r} is no range: start:stop:step, three numbers, is needed.") from None
    if not all(isfinite(float(number)) for number in (start, stop, step)):
        raise InputError(f"{name} = {text!r} is not allowed: the numbers of a range must be finite.")
    if step == 0:
        raise InputError(f"{name} = {text!r} is endless: a step other than 0 is needed.")
    steps = (stop - start) / step
    if steps < 0:
        raise InputError(f"{name} = {text!r} is empty: its step leads away from {stop}.")
    if steps >= MOST_JOBS:
        raise InputError(f"{name} = {text!r} holds {steps + 1:.3g} values: at most {MOST_JOBS} are allowed.")
    if steps != int(steps):
        raise InputError(f"{name} = {text!r}: steps of {step} from {start} do not meet {stop}, which is included.")
    return [f"{start + i * step:f}" for i in range(int(steps) + 1)]


def curve_parameter(varied: Mapping[str, list[str]]) -> str:
    """What readings are drawn against: the first force, else the first number, else the first parameter."""
    numeric = [name for name, words in varied.items() if len(words) > 1 and as_numbers(words)]
    return next((name for name in numeric if name in FORCES), next(iter(numeric), next(iter(varied))))
