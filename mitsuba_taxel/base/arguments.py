"""Checks of arguments; refusals name the parameter."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError


def require(name: str, value: object, kinds: type | tuple[type, ...], needed: str) -> None:
    """Raise `InputError` unless a value is of one of some types; True and False do not count as numbers."""
    allowed = kinds if isinstance(kinds, tuple) else (kinds,)
    if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
        raise refusal(name, value, f"{needed} is needed")


def refusal(name: str, value: object, needed: str) -> InputError:
    """The error that states the value given for a parameter, and what is needed."""
    shown = repr(value)
    return InputError(f"{name} = {shown if len(shown) <= 100 else type(value).__name__} is not allowed: {needed}.")


def path_of(name: str, value: object) -> Path:
    """A path, given as one or as text; raises `InputError` if it is neither, or no valid file name."""
    try:
        path = Path(os.fspath(value))  # type: ignore[call-overload]
    except TypeError:  # neither, or bytes
        raise refusal(name, value, "a path is needed") from None
    try:
        str(path).encode()
    except UnicodeEncodeError:  # Mitsuba takes no other names
        raise refusal(name, str(path), "a name in UTF-8, in a locale that has its letters, is needed") from None
    if "\0" in str(path):
        raise refusal(name, value, "a path is needed")
    return path


def text_of(name: str, value: str) -> str:
    """The value of a text parameter; raises `InputError` for text that Mitsuba cannot encode."""
    try:
        value.encode()
    except UnicodeEncodeError:
        raise refusal(name, value, "text in UTF-8, in a locale that has its letters, is needed") from None
    return value


def table_of(name: str, value: object, what: str) -> Mapping[str, Any]:
    """A mapping from names; None stands for an empty one. Raises `InputError` for anything else."""
    table: Any = {} if value is None else value
    if not isinstance(table, Mapping) or not all(isinstance(key, str) for key in table):
        raise refusal(name, value, f"a mapping of parameters' names to {what} is needed")
    return table


def array_of(name: str, numbers: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An array of finite numbers, of a given shape; raises `InputError` for anything else."""
    try:
        array = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != shape or not np.all(np.isfinite(array)):
        shown = f"{array.shape}" if len(shape) > 1 else f"{np.asarray(numbers, dtype=object).tolist()}"
        raise InputError(f"{name} = {shown} is not allowed: an array {shape} of finite numbers is needed.")
    return array


def is_number(value: object) -> bool:
    """Whether a value is a real number, finite in double precision; True and False are not."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def plain_number(value: Any) -> Any:
    """A number of NumPy's or of another library as one of Python's own, which files and kernels take; others stay."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)


def word_of(value: object) -> str:
    """The value of a scene's parameter as text; numbers of NumPy's have as many digits as they hold."""
    return str(value if isinstance(value, (str, np.generic)) else plain_number(value))


def as_numbers(words: Sequence[str]) -> list[float] | None:
    """Words as numbers, or None if one of them is not a finite number."""
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def is_whole(value: object) -> bool:
    """Whether a value is a whole number; True and False are not."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def check_whole(name: str, value: object, least: int, most: int) -> None:
    """Raise `InputError` unless this is a whole number within bounds."""
    if not (is_whole(value) and least <= value <= most):  # type: ignore[operator]
        raise refusal(name, value, f"a whole number from {least} to {most} is needed")


def check_seed(seed: object) -> None:
    """Raise `InputError` unless this is a seed of random numbers."""
    check_whole("seed", seed, 0, (1 << 32) - 1)


def check_fields(part: Any, **kinds: tuple[type | tuple[type, ...], str]) -> None:
    """Refuse fields of a dataclass that do not match their annotations, or the ``kinds`` given by name.

    Only annotations float, int and str are checked, alone or with None.
    """
    for field in fields(part):
        value = getattr(part, field.name)
        word, _, none = str(field.type).partition(" | ")
        if field.name in kinds:
            require(field.name, value, *kinds[field.name])
        elif none == "None" and value is None:
            continue
        elif word == "float" and not is_number(value):
            raise refusal(field.name, value, "a finite number is needed")
        elif word == "int" and not is_whole(value):
            raise refusal(field.name, value, "a whole number is needed")
        elif word == "str" and not isinstance(value, str):
            raise refusal(field.name, value, "text is needed")


def is_row(value: object, of: Callable[[object], bool]) -> bool:
    """Whether a value is a sequence or one-dimensional array whose items all satisfy ``of``; text is not."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and all(map(of, value))
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and all(map(of, value))


def names_of(name: str, value: object) -> tuple[str, ...]:
    """A sequence of names; raises `InputError` for anything else."""
    if not is_row(value, lambda one: isinstance(one, str)):
        raise refusal(name, value, "a row of names of parameters is needed")
    return tuple(value)  # type: ignore[arg-type]


def check_flags(**flags: object) -> None:
    """Raise `InputError` unless all of these are True or False."""
    for name, flag in flags.items():
        require(name, flag, (bool, np.bool_), "True or False")


def check_progress(progress: object) -> None:
    """Raise `InputError` unless this is None or can be called."""
    if not (progress is None or callable(progress)):
        raise refusal("progress", progress, "a function is needed")
