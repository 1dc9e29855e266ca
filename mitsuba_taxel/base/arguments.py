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
    """Check the type of a value; True and False do not count as numbers.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    value : object
        The value given.
    kinds : type or tuple[type, ...]
        That are allowed.
    needed : str
        The same in words, such as "a Pad".

    Raises
    ------
    InputError
        if it is of another type.
    """
    allowed = kinds if isinstance(kinds, tuple) else (kinds,)
    if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
        raise refusal(name, value, f"{needed} is needed")


def refusal(name: str, value: object, needed: str) -> InputError:
    """The error that states the value given for a parameter, and what is needed.

    Parameters
    ----------
    name : str
        Of the parameter.
    value : object
        The value given; one that is long in words is named by its type.
    needed : str
        What is allowed, with its verb: "a number above 0 is needed".

    Returns
    -------
    InputError
        To be raised.
    """
    shown = repr(value)
    return InputError(f"{name} = {shown if len(shown) <= 100 else type(value).__name__} is not allowed: {needed}.")


def path_of(name: str, value: object) -> Path:
    """A path, given as one or as text.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    value : object
        The value given.

    Returns
    -------
    Path
        Which need not exist.

    Raises
    ------
    InputError
        if it is neither, or no valid file name.
    """
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
    """The value of a text parameter.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    value : str
        The value given.

    Returns
    -------
    str
        The same.

    Raises
    ------
    InputError
        if Mitsuba cannot encode it.
    """
    try:
        value.encode()
    except UnicodeEncodeError:
        raise refusal(name, value, "text in UTF-8, in a locale that has its letters, is needed") from None
    return value


def table_of(name: str, value: object, what: str) -> Mapping[str, Any]:
    """A mapping from names of parameters; None stands for an empty one.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    value : object
        The value given.
    what : str
        What the names are mapped to, in words.

    Returns
    -------
    Mapping[str, Any]
        The mapping.

    Raises
    ------
    InputError
        if it is anything else.
    """
    table: Any = {} if value is None else value
    if not isinstance(table, Mapping) or not all(isinstance(key, str) for key in table):
        raise refusal(name, value, f"a mapping of parameters' names to {what} is needed")
    return table


def array_of(name: str, numbers: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An array of finite numbers.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    numbers : array_like
        The value given.
    shape : tuple[int, ...]
        That it must have.

    Returns
    -------
    ndarray of float
        Of that shape.

    Raises
    ------
    InputError
        if it has another shape, or holds anything but finite numbers.
    """
    try:
        array = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != shape or not np.all(np.isfinite(array)):
        shown = f"{array.shape}" if len(shape) > 1 else f"{np.asarray(numbers, dtype=object).tolist()}"
        raise InputError(f"{name} = {shown} is not allowed: an array {shape} of finite numbers is needed.")
    return array


def is_number(value: object) -> bool:
    """Whether a value is a real number, finite in double precision; True and False are not.

    Parameters
    ----------
    value : object
        Of any type.

    Returns
    -------
    bool
        Whether it is one.
    """
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def plain_number(value: Any) -> Any:
    """A number of NumPy's or of another library as one of Python's own, which files and kernels take; others stay.

    Parameters
    ----------
    value : Any
        Of any type.

    Returns
    -------
    Any
        An int, a float, or the value itself.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)


def word_of(value: object) -> str:
    """The value of a scene's parameter as text; numbers of NumPy's have as many digits as they hold.

    Parameters
    ----------
    value : object
        Text, a number, or anything with a text of its own.

    Returns
    -------
    str
        As a scene holds it.
    """
    return str(value if isinstance(value, (str, np.generic)) else plain_number(value))


def as_numbers(words: Sequence[str]) -> list[float] | None:
    """Words as numbers, or None if one of them is not a finite number.

    Parameters
    ----------
    words : sequence of str
        Of any kind.

    Returns
    -------
    list[float] or None
        One number for each word.
    """
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def is_whole(value: object) -> bool:
    """Whether a value is a whole number; True and False are not.

    Parameters
    ----------
    value : object
        Of any type.

    Returns
    -------
    bool
        Whether it is one.
    """
    return isinstance(value, Integral) and not isinstance(value, bool)


def check_whole(name: str, value: object, least: int, most: int) -> None:
    """Check a whole number within bounds.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    value : object
        The value given.
    least, most : int
        Bounds, both allowed.

    Raises
    ------
    InputError
        unless it is such a number.
    """
    if not (is_whole(value) and least <= value <= most):  # type: ignore[operator]
        raise refusal(name, value, f"a whole number from {least} to {most} is needed")


def check_seed(seed: object) -> None:
    """Check a seed of random numbers.

    Parameters
    ----------
    seed : object
        The value given.

    Raises
    ------
    InputError
        unless it is a whole number from 0 to 2**32 - 1.
    """
    check_whole("seed", seed, 0, (1 << 32) - 1)


def check_fields(part: Any, **kinds: tuple[type | tuple[type, ...], str]) -> None:
    """Refuse fields of a dataclass that do not match their annotations, or the ``kinds`` given by name.

    Only annotations float, int and str are checked, alone or with None.

    Parameters
    ----------
    part : dataclass instance
        Whose fields are checked.
    **kinds : tuple[type or tuple[type, ...], str]
        By the name of a field, its types, and what is needed in words.

    Raises
    ------
    InputError
        if a field is of another type, or a number is not finite.
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
    """Whether a value is a sequence or one-dimensional array whose items all satisfy ``of``; text is not.

    Parameters
    ----------
    value : object
        Of any type.
    of : Callable[[object], bool]
        Condition on each item.

    Returns
    -------
    bool
        Whether it is one.
    """
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and all(map(of, value))
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and all(map(of, value))


def names_of(name: str, value: object) -> tuple[str, ...]:
    """A sequence of names of parameters.

    Parameters
    ----------
    name : str
        Of the parameter, for messages.
    value : object
        The value given.

    Returns
    -------
    tuple[str, ...]
        In the same order.

    Raises
    ------
    InputError
        if it is anything else; a single text is.
    """
    if not is_row(value, lambda one: isinstance(one, str)):
        raise refusal(name, value, "a row of names of parameters is needed")
    return tuple(value)  # type: ignore[arg-type]


def check_flags(**flags: object) -> None:
    """Check flags.

    Parameters
    ----------
    **flags : object
        Values given, by the name of the parameter.

    Raises
    ------
    InputError
        unless all are True or False.
    """
    for name, flag in flags.items():
        require(name, flag, (bool, np.bool_), "True or False")


def check_progress(progress: object) -> None:
    """Check a function that is told of progress.

    Parameters
    ----------
    progress : object
        The value given.

    Raises
    ------
    InputError
        unless it is None or can be called.
    """
    if not (progress is None or callable(progress)):
        raise refusal("progress", progress, "a function is needed")
