"""Declarations of parameters as fields of a dataclass, by one function for each type, such as :func:`number`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, fields, replace
from types import MappingProxyType
from typing import Any

from mitsuba_taxel.parameters.parameter import (
    REQUIRED,
    Choice,
    Nested,
    Number,
    Parameter,
    Switch,
    Text,
    Transform,
    Vector,
    Whole,
    named,
)


def number(default: float | None, unit: str, doc: str, **about: Any) -> Any:
    """Declare a field for a finite number; see `Number` and `Parameter`.

    Parameters
    ----------
    default : float or None
        Default; `REQUIRED` if a value must be given.
    unit : str
        Unit; empty if dimensionless.
    doc : str
        Description for the reference, in sentences.
    **about : Any
        Other attributes of `Number`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Number(default=default, unit=unit, doc=doc, **about))


def whole(default: int, minimum: int, maximum: int, doc: str, **conditions: Any) -> Any:
    """Declare a field for a whole number; see `Whole` and `Parameter`.

    Parameters
    ----------
    default : int
        Default, within the bounds.
    minimum, maximum : int
        Bounds, inclusive.
    doc : str
        Description for the reference, in sentences.
    **conditions : Any
        Other attributes of `Parameter`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Whole(default=default, minimum=minimum, maximum=maximum, doc=doc, **conditions))


def switch(default: bool, doc: str, **conditions: Any) -> Any:
    """Declare a field for true or false; see `Parameter`.

    Parameters
    ----------
    default : bool
        Default.
    doc : str
        Description for the reference, in sentences.
    **conditions : Any
        Other attributes of `Parameter`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Switch(default=default, doc=doc, **conditions))


def text(default: str | None, doc: str, what: str = "text", **conditions: Any) -> Any:
    """Declare a field for any text; see `Text` and `Parameter`.

    Parameters
    ----------
    default : str or None
        Default; `REQUIRED` if a value must be given.
    doc : str
        Description for the reference, in sentences.
    what : str
        Description of the text that is needed, for messages.
    **conditions : Any
        Other attributes of `Parameter`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Text(default=default, what=what, doc=doc, **conditions))


def choice(default: str | None, allowed: Mapping[str, str] | Sequence[str], doc: str, **conditions: Any) -> Any:
    """Declare a field for a word from a list of allowed words; see `Choice` and `Parameter`.

    Parameters
    ----------
    default : str or None
        Default, an allowed word; None if the parameter may be absent.
    allowed : Mapping[str, str] or sequence of str
        The allowed words, with their meanings if these are not obvious.
    doc : str
        Description for the reference, in sentences.
    **conditions : Any
        Other attributes of `Parameter`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    table = allowed if isinstance(allowed, Mapping) else dict.fromkeys(allowed, "")
    return parameter_field(Choice(default=default, allowed=table, doc=doc, **conditions))


def kind(default: str, family: Any, doc: str, also: Mapping[str, str] = MappingProxyType({}), **conditions: Any) -> Any:
    """Declare a field for the name of a kind of a family, such as a cell shape, or for a word of ``also``.

    The field holds the name, as that of a `Choice`; the names are those of the subclasses of a `Kind`.

    Parameters
    ----------
    default : str
        Default, an allowed name or word.
    family : type[Kind]
        Family whose kinds are allowed, including kinds defined by a user.
    doc : str
        Description for the reference, in sentences.
    also : Mapping[str, str]
        Additional words, with their meanings.
    **conditions : Any
        Other attributes of `Parameter`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(
        Choice(default=default, allowed=_Meanings(family, also), family=family, doc=doc, **conditions)
    )


def vector(default: tuple[float, float, float], unit: str, doc: str, **conditions: Any) -> Any:
    """Declare a field for three numbers; see `Vector` and `Parameter`.

    Parameters
    ----------
    default : tuple[float, float, float]
        Default, in the unit.
    unit : str
        Unit; empty if dimensionless.
    doc : str
        Description for the reference, in sentences.
    **conditions : Any
        Other attributes of `Parameter`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Vector(default=default, unit=unit, doc=doc, **conditions))


def transform(doc: str) -> Any:
    """Declare a field for a transformation, or None; see `Transform`.

    Parameters
    ----------
    doc : str
        Description for the reference, in sentences.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Transform(doc=doc))


def nested(kind: str, made_of: type, default: Any, doc: str, **about: Any) -> Any:
    """Declare a field for the Python object of a nested plugin; see `Nested`.

    Parameters
    ----------
    kind : str
        XML element of the other plugin.
    made_of : type
        Class of its Python object.
    default : Any
        Default: an object of that class, or None.
    doc : str
        Description for the reference, in sentences.
    **about : Any
        Other attributes of `Nested`, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    return parameter_field(Nested(kind=kind, made_of=made_of, default=default, doc=doc, **about))


def parameter_field(parameter: Parameter, **changes: Any) -> Any:
    """Declare a field for an existing parameter, some of whose attributes are changed.

    Parameters
    ----------
    parameter : Parameter
        The parameter.
    **changes : Any
        Changed attributes of the parameter, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    parameter = replace(parameter, **changes)
    default = None if parameter.is_conditional or parameter.default is REQUIRED else parameter.default
    return field(default=default, metadata={"parameter": parameter})


def field_of(owner: Any, field: str, **changes: Any) -> Any:
    """Declare a field like that of another class, with some attributes of its parameter changed.

    Parameters
    ----------
    owner : type
        The other class.
    field : str
        Name of its field.
    **changes : Any
        Changed attributes of the parameter, by name.

    Returns
    -------
    Any
        A field for the body of a dataclass.
    """
    (parameter,) = (entry.metadata["parameter"] for entry in fields(owner) if entry.name == field)
    return parameter_field(named(parameter, field), **changes)


class _Meanings(Mapping[str, str]):
    """Mapping from names to meanings, for the kinds of a family, including kinds that are defined later, and for
    additional words."""

    def __init__(self, family: Any, also: Mapping[str, str]) -> None:
        self._family, self._also = family, also

    def __getitem__(self, name: str) -> str:
        return self._also[name] if name in self._also else self._family.kinds()[name].meaning

    def __iter__(self) -> Iterator[str]:
        return iter([*self._family.kinds(), *self._also])

    def __len__(self) -> int:
        return len(self._family.kinds()) + len(self._also)
