"""Rules that assign the faces of a pad to roof, side, bottom, top and outer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.toml import read_toml
from mitsuba_taxel.pads.regions import REGIONS


@dataclass(frozen=True)
class Rule:
    """Assigns a region to the faces that match all of its conditions.

    A face is a triangle of an STL, PLY or OBJ file, or a face of a STEP file. Heights and boxes are compared with its
    centroid, and ``normal`` with its mean normal (a face that curves all round has none).

    Parameters
    ----------
    region : str
        ``roof``, ``side``, ``bottom``, ``top`` or ``outer``.
    face : str, optional
        Name of the face in a STEP file.
    normal, within : tuple[float, float, float], optional and float
        Direction out of the silicone, and largest angle of the face's normal to it, in degrees.
    above, below : float, optional
        Lowest and highest z, in mm.
    box : tuple[tuple[float, float, float], tuple[float, float, float]], optional
        Two opposite corners of a box that contains the face's centroid, in mm.

    Raises
    ------
    InputError
        If a value is not of the right type.
    """

    region: str
    face: str | None = None
    normal: tuple[float, float, float] | None = None
    within: float = 45.0
    above: float | None = None
    below: float | None = None
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.region, str) or self.region not in REGIONS:
            raise InputError(f"region = {self.region!r} is not allowed: one of {', '.join(REGIONS)} is needed.")
        if self.face is not None and not isinstance(self.face, str):
            raise InputError(f"face = {self.face!r} is not allowed: a name is needed.")
        for name in ("above", "below"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _numbers(name, getattr(self, name), ()).item())
        within = _numbers("within", self.within, ()).item()
        if not 0 < within <= 180:
            raise InputError(f"within = {within:g} is not allowed: an angle above 0 and up to 180 degrees is needed.")
        object.__setattr__(self, "within", within)
        if self.normal is not None:
            normal = _numbers("normal", self.normal, (3,))
            if not normal.any():
                raise InputError(
                    f"normal = {tuple(normal.tolist())} is not allowed: three numbers, not all 0, are needed."
                )
            object.__setattr__(self, "normal", tuple(normal.tolist()))
        if self.box is not None:
            corners = _numbers("box", self.box, (2, 3))
            ordered = np.array([corners.min(axis=0), corners.max(axis=0)])
            object.__setattr__(self, "box", tuple(map(tuple, ordered.tolist())))


def _numbers(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """The value as an array of finite numbers of this shape; raises `InputError` otherwise."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.array(math.nan)
    if array.shape != shape or not np.all(np.isfinite(array)):
        needed = {
            (): "a finite number is",
            (3,): "three finite numbers are",
            (2, 3): "two corners of three numbers are",
        }
        raise InputError(f"{name} = {value!r} is not allowed: {needed[shape]} needed.")
    return array


def read_rules(path: str | Path) -> tuple[Rule, ...]:
    """The rules of a TOML file: one table ``[[rule]]`` for each, with the parameters of :class:`Rule`.

    Parameters
    ----------
    path : str or Path
        The TOML file.

    Returns
    -------
    tuple[Rule, ...]
        Rules in the order of the file; the first rule that matches a face applies.

    Raises
    ------
    InputError
        if the file cannot be read, is not valid TOML, or has other content.
    """
    tables = read_toml(f"regions = {path}", Path(path))
    rules = tables.pop("rule", [])
    if tables or not isinstance(rules, list) or not all(isinstance(rule, Mapping) for rule in rules):
        other = ", ".join(tables) or "a rule that is no [[rule]] table"
        raise InputError(f"regions = {path} is not allowed: it holds {other}; only [[rule]] tables are allowed.")
    return tuple(_rule(path, number, rule) for number, rule in enumerate(rules, start=1))


def _rule(path: str | Path, number: int, table: Mapping[str, Any]) -> Rule:
    names = [field.name for field in fields(Rule)]
    unknown = [name for name in table if name not in names]
    if unknown or "region" not in table:
        missing = f"{' '.join(unknown[0].split())} is no condition" if unknown else "region is missing"
        raise InputError(f"regions = {path} is not allowed: in rule {number}, {missing}; known are {', '.join(names)}.")
    try:
        return Rule(**table)
    except InputError as error:
        raise InputError(f"regions = {path} is not allowed: in rule {number}, {error}") from error
