"""Parameters: kind, unit, range, default, meaning, and the conditions under which they apply.

A parameter is declared as a field of a dataclass, by :func:`number` and the like. All else is derived from that: checks
and their messages, tables of the documentation, the schema of scenes, units of studies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.arguments import is_number, is_whole, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters.similarity import similarity_scale

LARGEST = 1e18
"""Largest magnitude of a number: its square is still finite in single precision."""
REQUIRED: Any = ...
"""Default of parameters that must be given if they apply."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of a plugin.

    Attributes
    ----------
    doc : str
        Its meaning, in sentences.
    name : str
        As in a scene.
    unit : str
        Empty if dimensionless.
    default : Any
        :data:`REQUIRED` if there is none; None if the parameter may be absent, or follows from others.
    default_words : str
        The default in words, if its value does not tell.
    when : tuple[str, ...]
        Another parameter, and its values for which this one applies; empty for all.
    without, needs : str
        Another parameter that this one excludes, or requires; empty for none.
    """

    doc: str
    name: str = ""
    unit: str = ""
    default: Any = None
    default_words: str = ""
    when: tuple[str, ...] = ()
    without: str = ""
    needs: str = ""

    type: ClassVar[str]
    """Mitsuba's name of the type."""

    def checked(self, value: Any) -> Any:
        """A value converted to its Python type; raises `InputError` if it is not allowed."""
        raise NotImplementedError

    def words(self, value: Any) -> str:
        """A value as text."""
        return str(value)

    @property
    def range(self) -> str:
        """The allowed range, in words to follow "a number"; empty if unlimited."""
        return ""

    @property
    def needed(self) -> str:
        """What is needed, in words."""
        raise NotImplementedError

    @property
    def default_text(self) -> str:
        """The default in words; empty where a value must be given."""
        if self.default_words:
            return self.default_words
        return "" if self.default is REQUIRED else "none" if self.default is None else self.words(self.default)

    @property
    def is_conditional(self) -> bool:
        """Whether its use depends on other parameters."""
        return bool(self.when or self.without or self.needs)

    @property
    def label(self) -> str:
        """Its name in a table."""
        return self.name

    @property
    def meaning(self) -> str:
        """Meaning, allowed values and conditions."""
        *others, last = [f"`{word}`" for word in self.when[1:]] or [""]
        words = f"{', '.join(others)} or {last}" if others else last
        only = f"for {self.when[0]} {words}" if self.when else ""
        beside = f"with {self.needs}" if self.needs else f"instead of {self.without}" if self.without else ""
        facts = "; ".join(filter(None, (self.range.removeprefix("of "), only, beside)))
        return f"{self.doc} {facts[0].upper()}{facts[1:]}." if facts else self.doc

    @property
    def description(self) -> str:
        """Meaning and default."""
        return self.meaning + self._default_in_brackets

    @property
    def description_with_unit(self) -> str:
        """Meaning, unit and default."""
        return self.meaning + (f" In {self.unit}." if self.unit else "") + self._default_in_brackets

    @property
    def _default_in_brackets(self) -> str:
        return f" (Default: {self.default_text})" if self.default_text else ""

    @property
    def shown(self) -> str:
        """The parameter as a scene has it, for messages."""
        return self.name

    def conflict(self, given: Any) -> str:
        """Why it is not allowed with the other values ``given``, as attributes of an object; empty if it is."""
        if self.when and (chosen := getattr(given, self.when[0])) not in self.when[1:]:
            words = ", ".join(map(repr, self.when[1:]))
            return f"{self.name} is not allowed for {self.when[0]} = {chosen!r}, only for {words}."
        if self.without and getattr(given, self.without) is not None:
            return f"{self.shown} and {self.without} exclude each other: one of them is needed."
        if self.needs and getattr(given, self.needs) is None:
            return f"{self.name} is not allowed without {self.needs}."
        return ""


@dataclass(frozen=True, kw_only=True)
class Number(Parameter):
    """A finite number.

    Attributes
    ----------
    above, minimum, maximum : float
        Exclusive lower bound; inclusive bounds.
    common : tuple[float, float] or None
        Usual range, outside which `taxel check` warns; None for no such range.
    hint : str
        Advice for values out of range.
    """

    above: float = -math.inf
    minimum: float = -math.inf
    maximum: float = math.inf
    common: tuple[float, float] | None = None
    hint: str = ""

    type: ClassVar[str] = "float"

    def checked(self, value: Any) -> float:
        if not (is_number(value) and value > self.above and self.minimum <= value <= self.maximum):
            raise _refused(self, value, self.words(value) if isinstance(value, float) else "")
        if abs(value) > LARGEST:
            raise InputError(f"{self.name} = {value:g} is not allowed: a number of at most {LARGEST:g} is needed.")
        return float(value)

    def words(self, value: Any) -> str:
        return f"{value:g}"

    @property
    def range(self) -> str:
        return describe_range(self.above, self.minimum, self.maximum)

    @property
    def needed(self) -> str:
        return " ".join(filter(None, ("a finite number", self.range, "is needed"))) + self.hint


@dataclass(frozen=True, kw_only=True)
class Whole(Parameter):
    """A whole number, from ``minimum`` to ``maximum``."""

    minimum: int
    maximum: int

    type: ClassVar[str] = "int"

    def checked(self, value: Any) -> int:
        if not is_whole(value) or not self.minimum <= value <= self.maximum:
            raise _refused(self, value)
        return int(value)

    @property
    def range(self) -> str:
        return f"from {self.minimum} to {self.maximum}"

    @property
    def needed(self) -> str:
        return f"a whole number {self.range} is needed"


@dataclass(frozen=True, kw_only=True)
class Switch(Parameter):
    """True or false."""

    type: ClassVar[str] = "boolean"
    allowed: ClassVar[tuple[str, str]] = ("true", "false")

    def checked(self, value: Any) -> bool:
        if not isinstance(value, bool):
            raise _refused(self, value)
        return value

    def words(self, value: Any) -> str:
        return str(value).lower()

    @property
    def needed(self) -> str:
        return "true or false is needed"


@dataclass(frozen=True, kw_only=True)
class Text(Parameter):
    """Any text, described by ``what``."""

    what: str = "text"

    type: ClassVar[str] = "string"

    def checked(self, value: Any) -> str:
        if not isinstance(value, str):
            raise _refused(self, value)
        return value

    @property
    def needed(self) -> str:
        return f"{self.what} is needed"


@dataclass(frozen=True, kw_only=True)
class Points(Text):
    """Pairs of numbers as text, separated by ';', or as rows, which become such text."""

    what: str = "pairs of finite numbers, separated by ';',"

    def checked(self, value: Any) -> str:
        rows = [row.split() for row in value.split(";")] if isinstance(value, str) else value
        try:
            pairs = [tuple(map(float, row)) for row in rows]
        except (TypeError, ValueError, OverflowError):
            pairs = [()]
        if not pairs or not all(len(pair) == 2 and all(map(math.isfinite, pair)) for pair in pairs):
            raise _refused(self, value)
        return "; ".join(f"{one:.16g} {other:.16g}" for one, other in pairs)

    @property
    def needed(self) -> str:
        return f"{self.what} are needed"


@dataclass(frozen=True, kw_only=True)
class Choice(Parameter):
    """One of some words, each with its meaning, or nothing if that is obvious.

    Attributes
    ----------
    allowed : Mapping[str, str]
    family : type[Kind], optional
        Family of the kinds that are chosen among; the parameters of a kind then apply where it is chosen.
    """

    allowed: Mapping[str, str]
    family: Any = None

    type: ClassVar[str] = "string"

    def checked(self, value: Any) -> str:
        if not isinstance(value, str) or value not in self.allowed:
            raise _refused(self, value)
        return value

    @property
    def range(self) -> str:
        words = [f"`{word}`" + (f" ({meaning})" if meaning else "") for word, meaning in self.allowed.items()]
        return "one of " + ", ".join(words)

    @property
    def needed(self) -> str:
        return f"one of {', '.join(self.allowed)} is needed"


@dataclass(frozen=True, kw_only=True)
class Vector(Parameter):
    """Three finite numbers, each ``above`` a bound.

    Attributes
    ----------
    common : tuple[float, float] or None
        As of a `Number`.
    is_direction : bool
        Whether one of them must not be 0.
    """

    above: float = -math.inf
    is_direction: bool = False
    common: tuple[float, float] | None = None

    type: ClassVar[str] = "vector"

    def checked(self, value: Any) -> tuple[float, ...]:
        try:
            numbers = tuple(float(component) for component in value)
        except (TypeError, ValueError, OverflowError):
            raise _refused(self, value) from None
        allowed = (is_number(component) and component > self.above for component in numbers)
        if len(numbers) != 3 or not all(allowed) or (self.is_direction and not any(numbers)):
            raise _refused(self, value, self.words(numbers))
        return numbers

    def words(self, value: Any) -> str:
        return ", ".join(f"{component:g}" for component in value)

    @property
    def range(self) -> str:
        return describe_range(self.above, -math.inf, math.inf)

    @property
    def needed(self) -> str:
        if self.is_direction:
            return "three finite numbers, not all 0, are needed"
        return " ".join(filter(None, ("three finite numbers", self.range, "are needed")))


@dataclass(frozen=True, kw_only=True)
class Transform(Parameter):
    """A rigid motion with at most a uniform scale, as ``mi.ScalarTransform4f``."""

    type: ClassVar[str] = "transform"

    def checked(self, value: Any) -> Any:
        if not hasattr(value, "matrix"):
            raise _refused(self, value)
        similarity_scale(np.array(value.matrix, dtype=float))
        return value

    @property
    def needed(self) -> str:
        return "a transformation is needed"


@dataclass(frozen=True, kw_only=True)
class Nested(Parameter):
    """An object nested in a plugin's element.

    Attributes
    ----------
    kind : str
        Of its plugin, as ``bsdf``.
    made_of : Any
        Class of the corresponding Python object, None if there is none.
    by_name : bool
        Whether it is identified by its name, not only by its kind.
    """

    kind: str
    made_of: Any = None
    by_name: bool = False

    @property
    def type(self) -> str:  # type: ignore[override]
        return self.kind

    @property
    def default_text(self) -> str:
        return self.default_words

    @property
    def label(self) -> str:
        return self.name if self.by_name else "(nested)"

    @property
    def shown(self) -> str:
        return self.name if self.by_name else f"<{self.kind}> ({self.name} in Python)"

    def checked(self, value: Any) -> Any:
        if not isinstance(value, self.made_of):
            raise _refused(self, value)
        return value

    @property
    def needed(self) -> str:
        article = "an" if self.made_of.__name__[0] in "AEIOU" else "a"
        return f"{article} {self.made_of.__name__} is needed"


def number(default: float | None, unit: str, doc: str, **about: Any) -> Any:
    """A field for a finite number; see `Number` and `Parameter`.

    Parameters
    ----------
    default : float or None
        REQUIRED for none.
    unit : str
        Empty if dimensionless.
    doc : str
        For the reference, in sentences.
    **about : Any
        Other attributes of `Number`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Number(default=default, unit=unit, doc=doc, **about))


def whole(default: int, minimum: int, maximum: int, doc: str, **conditions: Any) -> Any:
    """A field for a whole number; see `Whole` and `Parameter`.

    Parameters
    ----------
    default : int
        Within the bounds.
    minimum, maximum : int
        Both allowed.
    doc : str
        For the reference, in sentences.
    **conditions : Any
        Attributes of `Parameter`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Whole(default=default, minimum=minimum, maximum=maximum, doc=doc, **conditions))


def switch(default: bool, doc: str, **conditions: Any) -> Any:
    """A field for true or false; see `Parameter`.

    Parameters
    ----------
    default : bool
        As given if it is left out.
    doc : str
        For the reference, in sentences.
    **conditions : Any
        Attributes of `Parameter`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Switch(default=default, doc=doc, **conditions))


def text(default: str | None, doc: str, what: str = "text", **conditions: Any) -> Any:
    """A field for any text; see `Text` and `Parameter`.

    Parameters
    ----------
    default : str or None
        REQUIRED for none.
    doc : str
        For the reference, in sentences.
    what : str
        What is needed, for messages.
    **conditions : Any
        Attributes of `Parameter`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Text(default=default, what=what, doc=doc, **conditions))


def choice(default: str, allowed: Mapping[str, str] | Sequence[str], doc: str, **conditions: Any) -> Any:
    """A field for one of some words; see `Choice` and `Parameter`.

    Parameters
    ----------
    default : str
        One of the words.
    allowed : Mapping[str, str] or sequence of str
        The words, with their meanings.
    doc : str
        For the reference, in sentences.
    **conditions : Any
        Attributes of `Parameter`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    table = allowed if isinstance(allowed, Mapping) else dict.fromkeys(allowed, "")
    return stated(Choice(default=default, allowed=table, doc=doc, **conditions))


def kind(default: str, family: Any, doc: str, also: Mapping[str, str] = MappingProxyType({}), **conditions: Any) -> Any:
    """A field for the name of a kind of a family, or one of the words ``also``; see `Choice`.

    Parameters
    ----------
    default : str
        One of the names or words.
    family : type[Kind]
        Whose kinds are allowed, those of a user as well.
    doc : str
        For the reference, in sentences.
    also : Mapping[str, str]
        Further words, with their meanings.
    **conditions : Any
        Attributes of `Parameter`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Choice(default=default, allowed=_Meanings(family, also), family=family, doc=doc, **conditions))


def vector(default: tuple[float, float, float], unit: str, doc: str, **conditions: Any) -> Any:
    """A field for three numbers; see `Vector` and `Parameter`.

    Parameters
    ----------
    default : tuple[float, float, float]
        In the unit.
    unit : str
        Empty if dimensionless.
    doc : str
        For the reference, in sentences.
    **conditions : Any
        Attributes of `Parameter`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Vector(default=default, unit=unit, doc=doc, **conditions))


def transform(doc: str) -> Any:
    """A field for a transformation, or None; see `Transform`.

    Parameters
    ----------
    doc : str
        For the reference, in sentences.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Transform(doc=doc))


def nested(kind: str, made_of: type, default: Any, doc: str, **about: Any) -> Any:
    """A field for the Python object of another plugin; see `Nested`.

    Parameters
    ----------
    kind : str
        XML element of the other plugin.
    made_of : type
        Class of its Python object.
    default : Any
        Such an object, or None.
    doc : str
        For the reference, in sentences.
    **about : Any
        Other attributes of `Nested`, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    return stated(Nested(kind=kind, made_of=made_of, default=default, doc=doc, **about))


def stated(parameter: Parameter, **changes: Any) -> Any:
    """A field for a parameter, with changes.

    Parameters
    ----------
    parameter : Parameter
        As another class states it.
    **changes : Any
        To its attributes, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    parameter = replace(parameter, **changes)
    default = None if parameter.is_conditional or parameter.default is REQUIRED else parameter.default
    return field(default=default, metadata={"parameter": parameter})


def taken(owner: Any, field: str, **changes: Any) -> Any:
    """A field for a parameter of another class, with other conditions or another default.

    Parameters
    ----------
    owner : type
        The other class.
    field : str
        Name of its field.
    **changes : Any
        To attributes of the parameter, by name.

    Returns
    -------
    Any
        For the body of a dataclass.
    """
    (own,) = (stated_field.metadata["parameter"] for stated_field in fields(owner) if stated_field.name == field)
    return stated(named(own, field), **changes)


def named(parameter: Parameter, name: str) -> Parameter:
    """A parameter with the name of its field, unless it has another."""
    return parameter if parameter.name else replace(parameter, name=name)


def describe_range(above: float, minimum: float, maximum: float) -> str:
    """Words for an allowed range, as ``above 0`` or ``from 0 to 1``; empty if it has no bounds."""
    parts = []
    if above > -math.inf:
        parts.append(f"above {above:g}")
    if minimum > -math.inf and maximum < math.inf:
        parts.append(f"from {minimum:g} to {maximum:g}")
    elif minimum > -math.inf:
        parts.append(f"of at least {minimum:g}")
    elif maximum < math.inf:
        parts.append(f"of at most {maximum:g}")
    return " and ".join(parts)


class _Meanings(Mapping[str, str]):
    """Meaning of each kind of a family, also of kinds that are defined later, and of some other words."""

    def __init__(self, family: Any, also: Mapping[str, str]) -> None:
        self._family, self._also = family, also

    def __getitem__(self, name: str) -> str:
        return self._also[name] if name in self._also else self._family.kinds()[name].meaning

    def __iter__(self) -> Iterator[str]:
        return iter([*self._family.kinds(), *self._also])

    def __len__(self) -> int:
        return len(self._family.kinds()) + len(self._also)


def _refused(parameter: Parameter, value: Any, shown: str = "") -> InputError:
    """The error for a value of a parameter that is not allowed, ``shown`` as text."""
    if not shown:
        return refusal(parameter.name, value, parameter.needed)
    return InputError(f"{parameter.name} = {shown} is not allowed: {parameter.needed}.")
