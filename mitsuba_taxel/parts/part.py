"""A photo-reflector described by a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number, is_row, path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.toml import read_toml
from mitsuba_taxel.parameters import REQUIRED, Checked, choice, number

SUFFIX = ".toml"
REFLECTORS = ("mirror", "white card")
"""With which datasheets measure distance curves."""


@dataclass(frozen=True)
class Side(Checked):
    """A die, emitter or detector, and the window above it; seen from above, with the body's centre as origin."""

    x: float = number(REQUIRED, "mm", "Of the middle of the die.")
    y: float = number(0.0, "mm", "Likewise.")
    window_x: float | None = number(None, "mm", "Of the middle of the window.", default_words="that of the die")
    window_y: float | None = number(None, "mm", "Likewise.", default_words="that of the die")
    window_width: float = number(REQUIRED, "mm", "Extent of the window along x.", above=0)
    window_length: float = number(REQUIRED, "mm", "Extent of the window along y.", above=0)
    window_shape: str = choice("rectangle", ("rectangle", "obround"), "An obround ends in half circles.")
    die_width: float = number(REQUIRED, "mm", "Extent of the die along x.", above=0)
    die_length: float = number(REQUIRED, "mm", "Extent of the die along y.", above=0)
    die_depth: float = number(0.0, "mm", "Of the die below the surface of the window.", minimum=0)
    law: str = choice(
        "lambertian", ("lambertian", "cosine_power"), "By which the die emits, or responds to a parallel beam."
    )
    exponent: float | None = number(
        1.0, "", "Of the cosine in air.", minimum=1, maximum=1e4, when=("law", "cosine_power")
    )

    def relative_to_lambert(self, cosine: np.ndarray) -> np.ndarray:
        """The response, or the intensity on the axis of 1, by the cosine of the angle in air, relative to Lambert's."""
        return np.ones_like(cosine) if self.exponent is None else cosine ** (self.exponent - 1)

    @property
    def window_centre(self) -> tuple[float, float]:
        """In mm."""
        return (self.x if self.window_x is None else self.window_x, self.y if self.window_y is None else self.window_y)

    def moved(self, shift: tuple[float, float, float]) -> Side:
        """With its die moved by x, y and z in mm; the window stays."""
        x, y = self.window_centre
        return replace(
            self, x=self.x + shift[0], y=self.y + shift[1], die_depth=self.die_depth - shift[2], window_x=x, window_y=y
        )

    def check_in(self, body: tuple[float, float, float]) -> None:
        """Raise `InputError` unless die and window lie within the top of a body, and the die within its height."""
        window = self.window_centre, (self.window_width, self.window_length)
        die = (self.x, self.y), (self.die_width, self.die_length)
        for what, (centres, extents) in (("window", window), ("die", die)):
            for axis, centre, extent, length in zip("xy", centres, extents, body, strict=False):
                if 2 * abs(centre) + extent > length * (1 + 1e-9):
                    raise InputError(f"its {what} lies over the edge of the body along {axis}.")
        if self.die_depth >= body[2]:
            raise InputError(
                f"die_depth = {self.die_depth:g} is not allowed: less than the height of the body, {body[2]:g}, is "
                "needed."
            )

    def _check(self) -> None:
        if self.window_shape == "obround" and self.window_width > self.window_length:
            raise InputError(
                "window_shape = 'obround' is not allowed: a window_length of at least its width is needed."
            )
        if self.exponent is not None and self.die_depth > 0:
            raise InputError(f"law = {self.law!r} is not allowed for a die below its window: 'lambertian' is needed.")


@dataclass(frozen=True, eq=False)
class Part:
    """A photo-reflector.

    Attributes
    ----------
    name, title, source : str
        Name of the part, its title, and the source of its numbers.
    body : tuple[float, float, float]
        Extent along x, y, z in mm.
    wavelength : float
        In nm.
    resin_index : float
        Refractive index of the resin above the dies.
    emitter, detector : Side
    electrical : dict[str, float]
        Figures of the datasheet, by a name with its unit.
    distance_curve : tuple[tuple[float, float], ...]
        Of the datasheet: height of a reflector above the windows in mm, and current relative to the largest.
    distance_reflector : str
        That of the curve: "mirror", or "white card", which scatters by Lambert's law.
    unknown : tuple[str, ...]
        What is not known, as the datasheet does not state it.
    sources : dict[str, str]
        Origin of the numbers that are not from ``source``, by names such as ``resin_index`` and ``emitter.die_width``.
    """

    name: str
    title: str
    source: str
    body: tuple[float, float, float]
    wavelength: float
    resin_index: float
    emitter: Side
    detector: Side
    electrical: dict[str, float] = field(default_factory=dict)
    distance_curve: tuple[tuple[float, float], ...] = ()
    distance_reflector: str = "mirror"
    unknown: tuple[str, ...] = ()
    sources: dict[str, str] = field(default_factory=dict)


def part_names() -> list[str]:
    """Names of the parts that ship with the package.

    Returns
    -------
    list[str]
        In alphabetical order.
    """
    return sorted(file.stem for file in _catalogue().glob(f"*{SUFFIX}"))


def read_part(part: str | Path) -> Part:
    """A part by its name in the catalogue, or from a TOML file of the same kind.

    Parameters
    ----------
    part : str or Path
        Name in the catalogue in any case, or path of a file that ends in .toml.

    Returns
    -------
    Part
        Lengths in mm.

    Raises
    ------
    InputError
        if there is no such part, or the file does not describe one.
    """
    path = path_of("part", part)
    file = _catalogue() / f"{path.name.lower()}{SUFFIX}" if path.suffix.lower() != SUFFIX else path
    if path.suffix.lower() != SUFFIX and file.stem not in part_names():
        raise InputError(f"part = {str(part)!r} is not known: {', '.join(part_names())}, or a TOML file, is needed.")
    content = read_toml(f"part {str(part)!r}", file)
    return _part(file.stem, content)


def _part(name: str, content: dict[str, Any]) -> Part:
    for key in content:
        if key not in _KINDS:
            raise InputError(f"part {name}: {key} is not known: allowed are {', '.join(_KINDS)}.")
    for key, table in content.items():
        for entry in table if isinstance(table, dict) else ():
            if entry in _KINDS and entry not in content and not (key == "sources" and isinstance(table[entry], str)):
                raise InputError(f"part {name}: {entry} stands in [{key}]: move it above the first line in brackets.")
    for key, (check, needed, required) in _KINDS.items():
        if key in content and not check(content[key]):
            raise InputError(f"part {name}: {key} = {content[key]!r} is not allowed: {needed} is needed.")
        if key not in content and required:
            raise InputError(f"part {name}: {key} is missing: {needed} is needed.")
    given: dict[str, Any] = {**content, "body": tuple(content["body"])}
    given |= {key: _side(name, key, content) for key in ("emitter", "detector")}
    given["unknown"] = tuple(content.get("unknown", ()))
    given["distance_curve"] = tuple((float(z), float(share)) for z, share in content.get("distance_curve", ()))
    _check_sources(name, content)
    return Part(name, **given)


def _check_sources(name: str, content: Mapping[str, Any]) -> None:
    """Refuse sources of what the file does not hold."""
    for key in content.get("sources", {}):
        table, _, entry = key.rpartition(".")
        if entry not in (content.get(table, {}) if table else content):
            raise InputError(f"part {name}: sources has {key}, which the file does not state.")


def _side(name: str, which: str, content: Mapping[str, Any]) -> Side:
    table = content[which]
    allowed = [one.name for one in fields(Side)]
    for key in table:
        if key not in allowed:
            raise InputError(f"part {name}: {key} of {which} is not known: allowed are {', '.join(allowed)}.")
    try:
        side = Side(**table)
        side.check_in(content["body"])
    except InputError as error:
        raise InputError(f"part {name}, {which}: {error}") from error
    return side


def _catalogue() -> Path:
    return Path(__file__).parent / "catalogue"


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_size(value: object) -> bool:
    return is_number(value) and value > 0  # type: ignore[operator]


def _is_row_of(count: int, value: Any, of: Callable[[object], bool]) -> bool:
    return is_row(value, of) and len(value) == count


_KINDS: dict[str, tuple[Callable[[Any], bool], str, bool]] = {
    "title": (_is_text, "text", True),
    "source": (_is_text, "text", True),
    "body": (lambda value: _is_row_of(3, value, _is_size), "three sizes in mm", True),
    "wavelength": (_is_size, "a number of nm above 0", True),
    "resin_index": (lambda value: is_number(value) and 1 <= value <= 4, "a number from 1 to 4", True),
    "emitter": (lambda value: isinstance(value, dict), "a table", True),
    "detector": (lambda value: isinstance(value, dict), "a table", True),
    "electrical": (lambda v: isinstance(v, dict) and all(map(is_number, v.values())), "a table of numbers", False),
    "distance_curve": (
        lambda value: is_row(value, lambda row: _is_row_of(2, row, is_number)),
        "rows of two numbers",
        False,
    ),
    "distance_reflector": (lambda value: value in REFLECTORS, " or ".join(map(repr, REFLECTORS)), False),
    "unknown": (lambda value: is_row(value, _is_text), "a row of words", False),
    "sources": (lambda v: isinstance(v, dict) and all(map(_is_text, v.values())), "a table of words", False),
}
"""Entries of a file: check, what is needed in words, and whether the entry is required."""
