"""Read a plugin's parameters, refusing what is not finite or out of range."""

from __future__ import annotations

import math
from typing import Any

from mitsuba_taxel.base.errors import InputError

LARGEST = 1e18
"""Largest magnitude of a number: its square is still one in single precision."""


def number(
    props: Any,
    name: str,
    default: float | None = None,
    *,
    above: float = -math.inf,
    minimum: float = -math.inf,
    maximum: float = math.inf,
) -> float:
    """The number called ``name`` in Mitsuba properties.

    Raises
    ------
    InputError
        if it is missing without a default, not a finite number, beyond :data:`LARGEST`, not greater than ``above``, or
        outside ``[minimum, maximum]``.
    """
    allowed = describe_range(above, minimum, maximum)
    if default is None and name not in props:
        raise InputError(f"{name} is missing: a number {allowed} is needed.")
    value = props.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{name} = {value!r} is not a number: a number {allowed} is needed.")
    if not math.isfinite(value) or value <= above or not minimum <= value <= maximum:
        raise InputError(f"{name} = {value:g} is not allowed: a finite number {allowed} is needed.")
    if abs(value) > LARGEST:
        raise InputError(f"{name} = {value:g} is not allowed: a number of at most {LARGEST:g} is needed.")
    return float(value)


def whole_number(props: Any, name: str, default: int, *, minimum: int, maximum: int) -> int:
    """The whole number called ``name``, within ``[minimum, maximum]``."""
    value = props.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not minimum <= value <= maximum:
        raise InputError(f"{name} = {value} is not allowed: a whole number from {minimum} to {maximum} is needed.")
    return value


def choice(props: Any, name: str, default: str, allowed: tuple[str, ...]) -> str:
    """The word called ``name``, one of ``allowed``."""
    value = props.get(name, default)
    if value not in allowed:
        raise InputError(f"{name} = {value!r} is not allowed: one of {', '.join(allowed)} is needed.")
    return value


def describe_range(above: float, minimum: float, maximum: float) -> str:
    """Words for an allowed range, as ``above 0`` or ``from 0 to 1``."""
    parts = []
    if above > -math.inf:
        parts.append(f"above {above:g}")
    if minimum > -math.inf and maximum < math.inf:
        parts.append(f"from {minimum:g} to {maximum:g}")
    elif minimum > -math.inf:
        parts.append(f"of at least {minimum:g}")
    elif maximum < math.inf:
        parts.append(f"of at most {maximum:g}")
    return " and ".join(parts) or "of any size"
