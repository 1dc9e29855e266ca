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
"""Reflectors with which datasheets measure distance curves."""
UNKNOWN = "unknown"
"""Value of a number of the geometry on which public sources are silent."""
_STAND_INS = {"x": 0.0, "window_width": 1e-6, "window_length": 1e-6, "die_width": 1e-6, "die_length": 1e-6}
"""Numbers in place of unknown ones while the others of a side are checked."""
_NUMBERS = {*_STAND_INS, "y", "window_x", "window_y", "die_depth", "exponent"}


@dataclass(frozen=True)
class Side(Checked):
    """The die of an emitter or detector, and the window above it, seen from above; lengths are in mm.

    The origin is the centre of the body.
    """

    x: float = number(REQUIRED, "mm", "Centre of the die along x.")
    y: float = number(0.0, "mm", "Centre of the die along y.")
    window_x: float | None = number(None, "mm", "Centre of the window along x.", default_words="that of the die")
    window_y: float | None = number(None, "mm", "Centre of the window along y.", default_words="that of the die")
    window_width: float = number(REQUIRED, "mm", "Extent of the window along x.", above=0)
    window_length: float = number(REQUIRED, "mm", "Extent of the window along y.", above=0)
    window_shape: str = choice(
        "rectangle", ("rectangle", "obround"), "Outline of the window. An obround ends in half circles."
    )
    die_width: float = number(REQUIRED, "mm", "Extent of the die along x.", above=0)
    die_length: float = number(REQUIRED, "mm", "Extent of the die along y.", above=0)
    die_depth: float = number(0.0, "mm", "Depth of the die below the surface of the window.", minimum=0)
    law: str = choice(
        "lambertian", ("lambertian", "cosine_power"), "Law by which the die emits, or responds to a parallel beam."
    )
    exponent: float | None = number(
        1.0, "", "Exponent of the cosine of the angle in air.", minimum=1, maximum=1e4, when=("law", "cosine_power")
    )

    def relative_to_lambert(self, cosine: np.ndarray) -> np.ndarray:
        """Response or intensity relative to Lambert's law, by the cosine of the angle in air; 1 on the axis."""
        return np.ones_like(cosine) if self.exponent is None else cosine ** (self.exponent - 1)

    @property
    def window_centre(self) -> tuple[float, float]:
        """Centre of the window above the die, x and y in mm."""
        return (self.x if self.window_x is None else self.window_x, self.y if self.window_y is None else self.window_y)

    def moved(self, shift: tuple[float, float, float]) -> Side:
        """A copy with the die moved by x, y and z in mm; the window stays in place."""
        x, y = self.window_centre
        return replace(
            self, x=self.x + shift[0], y=self.y + shift[1], die_depth=self.die_depth - shift[2], window_x=x, window_y=y
        )

    def check_in(self, body: tuple[float, float, float]) -> None:
        """Raise `InputError` unless die and window lie within the top of a body, and the die within its height.

        Parameters
        ----------
        body : tuple[float, float, float]
            Extent of the body along x, y, z in mm.
        """
        window = self.window_centre, (self.window_width, self.window_length)
        die = (self.x, self.y), (self.die_width, self.die_length)
        for name, (centres, extents) in (("window", window), ("die", die)):
            for axis, centre, extent, length in zip("xy", centres, extents, body, strict=False):
                if 2 * abs(centre) + extent > length * (1 + 1e-9):
                    raise InputError(f"its {name} extends beyond the edge of the body along {axis}.")
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Datasheet:
    """Values that the file of a photo-reflector states. Its geometry may be unknown; then no reading can be computed.

    Attributes
    ----------
    name, title, source : str
        Name of the part, its title, and the source of its numbers.
    body : tuple[float, float, float]
        Extent along x, y, z in mm.
    wavelength : float
        Wavelength of the light in nm.
    electrical : dict[str, float]
        Figures of the datasheet by name, which contains the unit.
    distance_curve : tuple[tuple[float, float], ...]
        Rows of the datasheet's curve: height of a reflector above the windows in mm, and current relative to the
        largest current.
    distance_reflector : str
        Reflector of that curve: "mirror", or "white card", which scatters by Lambert's law.
    unknown : tuple[str, ...]
        Properties that the datasheet does not specify.
    sources : dict[str, str]
        Origin of the numbers that are not from ``source``, by names such as ``resin_index`` and ``emitter.die_width``.
    stated : dict[str, Any]
        Entries of the file on the index of the resin, the emitter and the detector; unknown ones are `UNKNOWN`.
    """

    name: str
    title: str
    source: str
    body: tuple[float, float, float]
    wavelength: float
    electrical: dict[str, float] = field(default_factory=dict)
    distance_curve: tuple[tuple[float, float], ...] = ()
    distance_reflector: str = "mirror"
    unknown: tuple[str, ...] = ()
    sources: dict[str, str] = field(default_factory=dict)
    stated: dict[str, Any] = field(default_factory=dict)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the entries that a reading needs and the file states as unknown, such as ``emitter.x``."""
        names = ["resin_index"] if self.stated["resin_index"] == UNKNOWN else []
        for role in ("emitter", "detector"):
            names += [f"{role}.{entry}" for entry, value in self.stated[role].items() if value == UNKNOWN]
        return tuple(names)

    def with_numbers(self, numbers: Mapping[str, float]) -> Part:
        """A part with numbers in place of entries of the file, such as unknown ones.

        Parameters
        ----------
        numbers : Mapping[str, float]
            Numbers by names such as ``resin_index`` and ``emitter.die_width``.

        Returns
        -------
        Part
            The part.

        Raises
        ------
        InputError
            if a number is still missing, or is not allowed.
        """
        stated: dict[str, Any] = {
            key: dict(value) if isinstance(value, dict) else value for key, value in self.stated.items()
        }
        for name, number_ in numbers.items():
            role, _, entry = name.rpartition(".")
            (stated[role] if role else stated)[entry] = number_
        complete = replace(self, stated=stated)
        if complete.missing:
            raise InputError(
                f"part {self.name} has no geometry to compute readings with: its file states as unknown "
                f"{', '.join(complete.missing)}. A file of your own with these numbers, measured or fitted by `taxel "
                "fit`, is needed."
            )
        emitter, detector = (_side(self.name, role, stated[role], self.body) for role in ("emitter", "detector"))
        values: dict[str, Any] = {entry.name: getattr(complete, entry.name) for entry in fields(Datasheet)}
        return Part(**values, resin_index=float(stated["resin_index"]), emitter=emitter, detector=detector)


@dataclass(frozen=True, eq=False, kw_only=True)
class Part(Datasheet):
    """Description of a photo-reflector: body, dies, windows, electrical figures, and their sources.

    Attributes
    ----------
    resin_index : float
        Refractive index of the resin above the dies.
    emitter, detector : Side
        Dies and their windows.
    """

    resin_index: float
    emitter: Side
    detector: Side


def part_names() -> list[str]:
    """Names of the parts that ship with the package.

    Returns
    -------
    list[str]
        Names in alphabetical order.
    """
    return sorted(file.stem for file in _catalogue().glob(f"*{SUFFIX}"))


def read_part(part: str | Path) -> Part:
    """Read a part by its name in the catalogue, or from a TOML file of the same format.

    Parameters
    ----------
    part : str or Path
        Name in the catalogue, case-insensitive, or path of a file that ends in .toml.

    Returns
    -------
    Part
        The part; its lengths are in mm.

    Raises
    ------
    InputError
        if there is no such part, the file does not describe a part, or it states a needed number as unknown.
    """
    return read_datasheet(part).with_numbers({})


def read_datasheet(part: str | Path) -> Datasheet:
    """Read the known values of a part, by its name in the catalogue or from a TOML file. Parts of unknown geometry are
    allowed.

    Parameters
    ----------
    part : str or Path
        Name in the catalogue, case-insensitive, or path of a file that ends in .toml.

    Returns
    -------
    Datasheet
        Content of the file, in which numbers of the geometry may be unknown.

    Raises
    ------
    InputError
        if there is no such part, or the file does not describe a part.
    """
    path = path_of("part", part)
    file = _catalogue() / f"{path.name.lower()}{SUFFIX}" if path.suffix.lower() != SUFFIX else path
    if path.suffix.lower() != SUFFIX and file.stem not in part_names():
        raise InputError(f"part = {str(part)!r} is not known: {', '.join(part_names())} or a TOML file is needed.")
    content = read_toml(f"part {str(part)!r}", file)
    return _datasheet(file.stem, content)


def _datasheet(name: str, content: dict[str, Any]) -> Datasheet:
    """Create the part that the content of a file describes; raises `InputError`."""
    # Entries: known ones, above the first table, with allowed values, and all that are required.
    for key in content:
        if key not in _KINDS:
            raise InputError(f"part {name}: {key} is not known: allowed are {', '.join(_KINDS)}.")
    for key, table in content.items():
        for entry in table if isinstance(table, dict) else ():
            if entry in _KINDS and entry not in content and not (key == "sources" and isinstance(table[entry], str)):
                raise InputError(f"part {name}: {entry} is in [{key}]: move it above the first line in brackets.")
    for key, (check, needed, required) in _KINDS.items():
        if key in content and not check(content[key]):
            raise InputError(f"part {name}: {key} = {content[key]!r} is not allowed: {needed} is needed.")
        if key not in content and required:
            raise InputError(f"part {name}: {key} is missing: {needed} is needed.")

    # Lists become tuples. Sides are checked also where some of their numbers are unknown, with others in their place.
    arguments: dict[str, Any] = {**content, "body": tuple(content["body"])}
    arguments["stated"] = {key: arguments.pop(key) for key in ("resin_index", "emitter", "detector")}
    arguments["unknown"] = tuple(content.get("unknown", ()))
    arguments["distance_curve"] = tuple((float(z), float(current)) for z, current in content.get("distance_curve", ()))
    for role in ("emitter", "detector"):
        table = content[role]
        known = {entry: value for entry, value in table.items() if value != UNKNOWN}
        others = {entry: value for entry, value in _STAND_INS.items() if table.get(entry) == UNKNOWN}
        _side(name, role, {**known, **others}, arguments["body"])
        for entry in table.keys() - known.keys() - _NUMBERS:
            raise InputError(f"part {name}, {role}: {entry} = {UNKNOWN!r} is not allowed: only numbers may be unknown.")
    _check_sources(name, content)
    return Datasheet(name=name, **arguments)


def _check_sources(name: str, content: Mapping[str, Any]) -> None:
    """Raise `InputError` for a source of an entry that the file does not contain."""
    for key in content.get("sources", {}):
        table, _, entry = key.rpartition(".")
        if entry not in (content.get(table, {}) if table else content):
            raise InputError(
                f"part {name}: sources has {key}, which the file does not contain: add it, or take its source out."
            )


def _side(name: str, role: str, table: Mapping[str, Any], body: tuple[float, float, float]) -> Side:
    """Create the emitter or detector (``role``) of a part from its table in the file; raises `InputError`."""
    allowed = [entry.name for entry in fields(Side)]
    for key in table:
        if key not in allowed:
            raise InputError(f"part {name}: {key} of {role} is not known: allowed are {', '.join(allowed)}.")
    try:
        side = Side(**table)
        side.check_in(body)
    except InputError as error:
        raise InputError(f"part {name}, {role}: {error}") from error
    return side


def _catalogue() -> Path:
    return Path(__file__).parent / "catalogue"


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_size(value: object) -> bool:
    return is_number(value) and value > 0  # type: ignore[operator]


def _is_row_of(count: int, value: Any, is_item: Callable[[object], bool]) -> bool:
    return is_row(value, is_item) and len(value) == count


_KINDS: dict[str, tuple[Callable[[Any], bool], str, bool]] = {
    "title": (_is_text, "text", True),
    "source": (_is_text, "text", True),
    "body": (lambda value: _is_row_of(3, value, _is_size), "three sizes in mm", True),
    "wavelength": (_is_size, "a number of nm above 0", True),
    "resin_index": (
        lambda value: value == UNKNOWN or (is_number(value) and 1 <= value <= 4),
        f"a number from 1 to 4, or {UNKNOWN!r},",
        True,
    ),
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
"""Entries of a file: check, description of what is needed, and whether the entry is required."""
