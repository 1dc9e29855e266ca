"""Parameters: type, unit, range, default, meaning, and the conditions under which they apply.

A parameter is declared as a field of a dataclass, by the functions of `declarations`. Checks and their messages, tables
of the documentation, the schema of scenes and units of studies are derived from that declaration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.arguments import is_number, is_whole, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters.similarity import similarity_scale

LARGEST = 1e18
"""Largest magnitude of a number; its square is finite in single precision."""
REQUIRED: Any = ...
"""Default of parameters that must be given if they apply."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a plugin: its type, unit, default, meaning, and when it applies.

    Attributes
    ----------
    doc : str
        Meaning, in sentences.
    name : str
        Name in a scene.
    unit : str
        Unit; empty if dimensionless.
    default : Any
        Default; :data:`REQUIRED` if a value must be given, None if the parameter may be absent or follows from others.
    default_words : str
        Description of the default, if its value needs one.
    when : tuple[str, ...]
        Name of another parameter, followed by its values for which this parameter applies; empty if it always applies.
    choosers : tuple[str, ...]
        Names of further parameters; the parameter also applies if one of them has one of the values in ``when``.
    without, needs : str
        Name of another parameter that must not (``without``) or must (``needs``) be set together with this parameter;
        empty for none. Several excluded parameters are joined by "or".
    """

    doc: str
    name: str = ""
    unit: str = ""
    default: Any = None
    default_words: str = ""
    when: tuple[str, ...] = ()
    choosers: tuple[str, ...] = ()
    without: str = ""
    needs: str = ""

    type: ClassVar[str]
    """Name of the type in Mitsuba."""

    def checked(self, value: Any) -> Any:
        """The value, converted to its Python type; raises `InputError` if it is not allowed."""
        raise NotImplementedError

    def words(self, value: Any) -> str:
        """Format a value of the parameter as text."""
        return str(value)

    @property
    def range(self) -> str:
        """The allowed range in words, such as "above 0"; empty if unlimited. It follows "a number" in messages."""
        return ""

    @property
    def needed(self) -> str:
        """Description of the values that are allowed, for messages: "a whole number from 1 to 9 is needed"."""
        raise NotImplementedError

    @property
    def default_text(self) -> str:
        """Description of the default; empty if a value must be given."""
        if self.default_words:
            return self.default_words
        return "" if self.default is REQUIRED else "none" if self.default is None else self.words(self.default)

    @property
    def excluded(self) -> list[str]:
        """Names of parameters that this parameter excludes."""
        return self.without.split(" or ") if self.without else []

    @property
    def is_conditional(self) -> bool:
        """Whether the parameter applies only for some values of other parameters."""
        return bool(self.when or self.without or self.needs)

    @property
    def label(self) -> str:
        """Name of the parameter as shown in tables of the documentation."""
        return self.name

    @property
    def meaning(self) -> str:
        """Text for the documentation: meaning of the parameter, its allowed values, and the conditions under which it
        applies."""
        *values, last = [f"`{word}`" for word in self.when[1:]] or [""]
        words = f"{', '.join(values)} or {last}" if values else last
        condition = f"for {' or '.join((self.when[0], *self.choosers))} {words}" if self.when else ""
        dependence = f"with {self.needs}" if self.needs else f"instead of {self.without}" if self.without else ""
        facts = "; ".join(filter(None, (self.range.removeprefix("of "), condition, dependence)))
        return f"{self.doc} {facts[0].upper()}{facts[1:]}." if facts else self.doc

    @property
    def description(self) -> str:
        """Text for the documentation: meaning of the parameter and its default."""
        return self.meaning + self._default_in_brackets

    @property
    def description_with_unit(self) -> str:
        """Text for the documentation: meaning of the parameter, its unit and its default."""
        return self.meaning + (f" In {self.unit}." if self.unit else "") + self._default_in_brackets

    @property
    def _default_in_brackets(self) -> str:
        return f" (Default: {self.default_text})" if self.default_text else ""

    @property
    def shown(self) -> str:
        """Name of the parameter in a scene, as shown in messages."""
        return self.name

    def conflict(self, instance: Any) -> str:
        """Reason why the parameter is not allowed with the other values of an object, as a message; empty if it is
        allowed."""
        if self.when and all(getattr(instance, name) not in self.when[1:] for name in (self.when[0], *self.choosers)):
            words, chosen = ", ".join(map(repr, self.when[1:])), getattr(instance, self.when[0])
            return f"{self.name} is not allowed for {self.when[0]} = {chosen!r}, only for {words}."
        for name in self.excluded:
            if getattr(instance, name) is not None:
                return f"{self.shown} and {name} exclude each other: one of them is needed."
        if self.needs and getattr(instance, self.needs) is None:
            return f"{self.name} is not allowed without {self.needs}."
        return ""


@dataclass(frozen=True, kw_only=True)
class Number(Parameter):
    """A parameter whose value is a finite number.

    Attributes
    ----------
    above, minimum, maximum : float
        Exclusive lower bound (``above``), and inclusive bounds.
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
    """A parameter whose value is a whole number, from ``minimum`` to ``maximum``."""

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
    """A parameter whose value is true or false."""

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
    """A parameter whose value is any text; ``what`` describes it."""

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
    """A parameter whose value is a list of pairs of numbers, as text separated by ';' or as rows, which are converted
    into such text.
    """

    what: str = "pairs of finite numbers, separated by ';',"

    def checked(self, value: Any) -> str:
        rows = [row.split() for row in value.split(";")] if isinstance(value, str) else value
        try:
            pairs = [tuple(map(float, row)) for row in rows]
        except (TypeError, ValueError, OverflowError):
            pairs = [()]
        if not pairs or not all(len(pair) == 2 and all(map(math.isfinite, pair)) for pair in pairs):
            raise _refused(self, value)
        return "; ".join(f"{x:.16g} {y:.16g}" for x, y in pairs)

    @property
    def needed(self) -> str:
        return f"{self.what} are needed"


@dataclass(frozen=True, kw_only=True)
class Choice(Parameter):
    """A parameter whose value is a word from a list of allowed words.

    Attributes
    ----------
    allowed : Mapping[str, str]
        Meaning of each allowed word; empty if it is obvious.
    family : type[Kind], optional
        Family of kinds, if the words are names of kinds. The parameters of a kind apply if it is chosen.
    suffix : str
        Suffix of the names of files that are also allowed; empty if files are not allowed.
    """

    allowed: Mapping[str, str]
    family: Any = None
    suffix: str = ""

    type: ClassVar[str] = "string"

    def checked(self, value: Any) -> str:
        is_file = isinstance(value, str) and self.suffix and value.endswith(self.suffix)
        if not isinstance(value, str) or not (is_file or value in self.allowed):
            raise _refused(self, value)
        return value

    @property
    def range(self) -> str:
        words = [f"`{word}`" + (f" ({meaning})" if meaning else "") for word, meaning in self.allowed.items()]
        return "one of " + ", ".join(words) + (f", or the name of a file `*{self.suffix}`" if self.suffix else "")

    @property
    def needed(self) -> str:
        return f"one of {', '.join(self.allowed)}{f' or a file *{self.suffix}' if self.suffix else ''} is needed"


@dataclass(frozen=True, kw_only=True)
class Vector(Parameter):
    """A parameter whose value is three finite numbers, each ``above`` a bound.

    Attributes
    ----------
    common : tuple[float, float] or None
        Usual range, as for `Number`.
    is_direction : bool
        Whether at least one component must differ from 0.
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
    """A parameter whose value is a rigid motion with at most a uniform scale, as ``mi.ScalarTransform4f``."""

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
    """A parameter whose value is an object nested in the element of a plugin, such as a BSDF.

    Attributes
    ----------
    kind : str
        Kind of the plugin of the nested object, such as ``bsdf``.
    made_of : Any
        Class of the corresponding Python object, or None.
    by_name : bool
        Whether the object is recognised by its name in the scene; otherwise it is recognised by its kind alone.
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


def named(parameter: Parameter, name: str) -> Parameter:
    """The parameter, named as its field unless it already has a name."""
    return parameter if parameter.name else replace(parameter, name=name)


def describe_range(above: float, minimum: float, maximum: float) -> str:
    """Description of an allowed range, such as ``above 0`` or ``from 0 to 1``; empty if it has no bounds."""
    phrases = []
    if above > -math.inf:
        phrases.append(f"above {above:g}")
    if minimum > -math.inf and maximum < math.inf:
        phrases.append(f"from {minimum:g} to {maximum:g}")
    elif minimum > -math.inf:
        phrases.append(f"of at least {minimum:g}")
    elif maximum < math.inf:
        phrases.append(f"of at most {maximum:g}")
    return " and ".join(phrases)


def _refused(parameter: Parameter, value: Any, shown: str = "") -> InputError:
    """Create the error for a value of a parameter that is not allowed. ``shown`` is the value as text, by default its
    ``repr``."""
    if not shown:
        return refusal(parameter.name, value, parameter.needed)
    return InputError(f"{parameter.name} = {shown} is not allowed: {parameter.needed}.")
