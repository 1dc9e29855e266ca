"""Checks of arguments, and a limit of input; error messages name the parameter."""

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

MOST_HISTORY = 4000
"""Largest number of rows of a load history: each step of a path in time contains all earlier rows."""


def require(name: str, value: object, kinds: type | tuple[type, ...], needed: str) -> None:
    """Check the type of a value; True and False do not count as numbers.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    value : object
        Value of the parameter.
    kinds : type or tuple[type, ...]
        Allowed types.
    needed : str
        Description of these types, such as "a Pad".

    Raises
    ------
    InputError
        if the value is of another type.
    """
    allowed = kinds if isinstance(kinds, tuple) else (kinds,)
    if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
        raise refusal(name, value, f"{needed} is needed")


def refusal(name: str, value: object, needed: str) -> InputError:
    """The error for a parameter whose value is not allowed.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : object
        Value of the parameter; if its text is long, the message shows its type instead.
    needed : str
        Description of what is allowed, with a verb: "a number above 0 is needed".

    Returns
    -------
    InputError
        The error to raise.
    """
    shown = repr(value)
    return InputError(f"{name} = {shown if len(shown) <= 100 else type(value).__name__} is not allowed: {needed}.")


def path_of(name: str, value: object) -> Path:
    """Convert the value of a parameter to a ``Path``.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    value : object
        Value of the parameter.

    Returns
    -------
    Path
        The path, which need not exist.

    Raises
    ------
    InputError
        if the value is neither a path nor a text, or is not a valid file name.
    """
    try:
        path = Path(os.fspath(value))  # type: ignore[call-overload]
    except TypeError:  # neither a path nor a text, or bytes
        raise refusal(name, value, "a path is needed") from None
    try:
        str(path).encode()
    except UnicodeEncodeError:  # Mitsuba requires names in UTF-8
        raise refusal(name, str(path), "a name in UTF-8, in a locale that has its letters, is needed") from None
    if "\0" in str(path):
        raise refusal(name, value, "a path is needed")
    return path


def text_of(name: str, value: str) -> str:
    """Check that Mitsuba can encode the value of a text parameter.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    value : str
        Value of the parameter.

    Returns
    -------
    str
        The same value.

    Raises
    ------
    InputError
        if Mitsuba cannot encode the value.
    """
    try:
        value.encode()
    except UnicodeEncodeError:
        raise refusal(name, value, "text in UTF-8, in a locale that has its letters, is needed") from None
    return value


def table_of(name: str, value: object, what: str) -> Mapping[str, Any]:
    """Check that the value of a parameter is a mapping whose keys are names; None becomes an empty mapping.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    value : object
        Value of the parameter.
    what : str
        Description of the values of the mapping.

    Returns
    -------
    Mapping[str, Any]
        The mapping.

    Raises
    ------
    InputError
        if the value is not such a mapping.
    """
    table: Any = {} if value is None else value
    if not isinstance(table, Mapping) or not all(isinstance(key, str) for key in table):
        raise refusal(name, value, f"a dictionary from parameter names to {what} is needed")
    return table


def floats_of(values: Any) -> np.ndarray:
    """Convert a value to an array of floats; its shape and its numbers are not checked.

    Parameters
    ----------
    values : array_like
        Any value.

    Returns
    -------
    ndarray of float
        The array; of shape (0,) if it is no array of numbers.
    """
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def shape_of(values: Any) -> tuple[int, ...] | None:
    """Shape of a value.

    Parameters
    ----------
    values : array_like
        Any value.

    Returns
    -------
    tuple[int, ...] or None
        The shape; None if rows have different lengths.
    """
    try:
        return np.shape(values)
    except ValueError:
        return None


def shape_words(values: Any) -> str:
    """Shape of a value in words, for messages.

    Parameters
    ----------
    values : array_like
        Any value.

    Returns
    -------
    str
        Such as ``of shape (2, 3)``.
    """
    shape = shape_of(values)
    return "with rows of different lengths" if shape is None else f"of shape {shape}"


def array_of(name: str, numbers: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Convert the value of a parameter to an array, and check its shape and that all its numbers are finite.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    numbers : array_like
        Value of the parameter.
    shape : tuple[int, ...]
        Required shape.

    Returns
    -------
    ndarray of float
        Array of that shape.

    Raises
    ------
    InputError
        if the value has another shape, or an item is not a finite number.
    """
    array = floats_of(numbers)
    if array.shape != shape or not np.all(np.isfinite(array)):
        shown = f"{array.shape}" if len(shape) > 1 else f"{np.asarray(numbers, dtype=object).tolist()}"
        raise InputError(f"{name} = {shown} is not allowed: an array {shape} of finite numbers is needed.")
    return array


def is_number(value: object) -> bool:
    """Whether a value is a real number, finite in double precision; True and False do not count as numbers.

    Parameters
    ----------
    value : object
        Any value.

    Returns
    -------
    bool
        True for such a number.
    """
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def plain_number(value: Any) -> Any:
    """Convert a number of NumPy or another library to a number of Python, which files and kernels require.

    Parameters
    ----------
    value : Any
        Any value.

    Returns
    -------
    Any
        An int, a float, or the value itself if it is not a number.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)


def word_of(value: object) -> str:
    """Convert the value of a scene's parameter to text; a number of NumPy is written in the digits of its precision.

    Parameters
    ----------
    value : object
        Text, a number, or an object that ``str`` converts.

    Returns
    -------
    str
        Value as in a scene file.
    """
    return str(value if isinstance(value, (str, np.generic)) else plain_number(value))


def as_numbers(words: Sequence[str]) -> list[float] | None:
    """Convert words to numbers.

    Parameters
    ----------
    words : sequence of str
        Any words.

    Returns
    -------
    list[float] or None
        A number for each word; None if a word is not a finite number.
    """
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def is_whole(value: object) -> bool:
    """Whether a value is a whole number; True and False do not count as numbers.

    Parameters
    ----------
    value : object
        Any value.

    Returns
    -------
    bool
        True for such a number.
    """
    return isinstance(value, Integral) and not isinstance(value, bool)


def check_whole(name: str, value: object, least: int, most: int) -> None:
    """Check a whole number within bounds.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    value : object
        Value of the parameter.
    least, most : int
        Bounds, inclusive.

    Raises
    ------
    InputError
        unless the value is a whole number within the bounds.
    """
    if not (is_whole(value) and least <= value <= most):  # type: ignore[operator]
        raise refusal(name, value, f"a whole number from {least} to {most} is needed")


def check_seed(seed: object) -> None:
    """Check a seed of random numbers.

    Parameters
    ----------
    seed : object
        Value of the parameter.

    Raises
    ------
    InputError
        unless the seed is a whole number from 0 to 2**32 - 1.
    """
    check_whole("seed", seed, 0, (1 << 32) - 1)


def check_fields(instance: Any, **kinds: tuple[type | tuple[type, ...], str]) -> None:
    """Check that fields of a dataclass match their annotations, or the types in ``kinds``.

    Only fields with the annotations float, int and str, alone or with None, and fields in ``kinds`` are checked.

    Parameters
    ----------
    instance : dataclass instance
        Object whose fields are checked.
    **kinds : tuple[type or tuple[type, ...], str]
        For each field name, the allowed types and a description of them.

    Raises
    ------
    InputError
        if a field is of another type, or a number is not finite.
    """
    for field in fields(instance):
        value = getattr(instance, field.name)
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
    """Whether a value is a sequence or one-dimensional array whose items all satisfy a condition.

    Parameters
    ----------
    value : object
        Any value.
    of : Callable[[object], bool]
        Condition on each item.

    Returns
    -------
    bool
        False for text.
    """
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and all(map(of, value))
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and all(map(of, value))


def names_of(name: str, value: object) -> tuple[str, ...]:
    """Check that the value of a parameter is a sequence of names, and convert it to a tuple.

    Parameters
    ----------
    name : str
        Name of the parameter, for messages.
    value : object
        Value of the parameter.

    Returns
    -------
    tuple[str, ...]
        The names, in the same order.

    Raises
    ------
    InputError
        if the value is not a sequence of names; a single text is refused.
    """
    if not is_row(value, lambda item: isinstance(item, str)):
        raise refusal(name, value, "a list of parameter names is needed")
    return tuple(value)  # type: ignore[arg-type]


def check_flags(**flags: object) -> None:
    """Check that parameters are True or False.

    Parameters
    ----------
    **flags : object
        Values by the name of the parameter.

    Raises
    ------
    InputError
        if a value is neither True nor False.
    """
    for name, flag in flags.items():
        require(name, flag, (bool, np.bool_), "True or False")


def check_progress(progress: object) -> None:
    """Check a function that is called with the progress of a run.

    Parameters
    ----------
    progress : object
        Value of the parameter.

    Raises
    ------
    InputError
        unless it is None or callable.
    """
    if not (progress is None or callable(progress)):
        raise refusal("progress", progress, "a function is needed")
