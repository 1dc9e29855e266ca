"""Dataclasses whose fields are parameters: checked, read from a scene, and written to one."""

from __future__ import annotations

import inspect
import math
import re
from abc import ABCMeta
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters.parameter import REQUIRED, Choice, Nested, Number, Parameter, named


class _TakesOwnParameters(ABCMeta):
    """Makes objects whose arguments may be parameters of kinds."""

    def __call__(cls, *given: Any, **values: Any) -> Any:
        own = dict(values.pop("kind_values", ()))
        own |= {name: values.pop(name) for name in _own_parameters(cls) if name in values}
        pairs = sorted((name, value) for name, value in own.items() if value is not None)
        return super().__call__(*given, **values, **({"kind_values": tuple(pairs)} if pairs else {}))

    @property
    def __signature__(cls) -> inspect.Signature:
        """Fields, then parameters of kinds, as help and editors show them."""
        _, *fields_given = inspect.signature(cls.__init__).parameters.values()  # type: ignore[misc]
        own = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in _own_parameters(cls)]
        return inspect.Signature([*(field for field in fields_given if field.name != "kind_values"), *own])


class Checked:
    """Base of frozen dataclasses whose fields are parameters, checked when an object is made.

    Parameters that do not apply are None; those that apply take their default. Further conditions between parameters
    are checked by :meth:`_check`.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        made = {name: value.metadata for name, value in vars(cls).items() if isinstance(value, Field)}
        stated = {name: about["parameter"] for name, about in made.items() if "parameter" in about}
        if stated and cls.__doc__:
            stated = _with_users({name: named(parameter, name) for name, parameter in stated.items()})
            types = {name: str(kind).replace(" | None", ", optional") for name, kind in cls.__annotations__.items()}
            rows = "\n".join(f"{name} : {types[name]}\n    {p.description_with_unit}" for name, p in stated.items())
            head, mark, rest = re.split(r"(\n\n(?:Raises|Notes)\n|$)", inspect.cleandoc(cls.__doc__), maxsplit=1)
            cls.__doc__ = "".join([head, "\n\nParameters\n----------\n", rows.replace("`", "``"), mark, rest])

    def __post_init__(self) -> None:
        check(self)
        self._check()

    def _check(self) -> None:
        """Refuse inconsistent values."""

    @classmethod
    def read(cls, props: Any) -> Any:
        """An object with the values of ``mi.Properties``; raises `InputError`."""
        given = {}
        for attribute, parameter in parameters_of(cls).items():
            if isinstance(parameter, Nested):
                value = _specification_of(props, parameter)
            else:
                value = props.get(parameter.name) if parameter.name in props else None
            if value is not None:
                given[attribute] = value
        return cls(**given)


@dataclass(frozen=True)
class Kinded(Checked, metaclass=_TakesOwnParameters):
    """Base of frozen dataclasses of parameters, some of which choose a kind (see `kind`).

    The parameters of the chosen kind are arguments and attributes like the others, though they are no fields: kinds may
    be defined at any time.

    Parameters
    ----------
    kind_values : tuple[tuple[str, Any], ...]
        Names and values of the kinds' parameters, sorted by name; set by giving them one by one.
    """

    kind_values: tuple[tuple[str, Any], ...] = field(default=(), kw_only=True, repr=False)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.__repr__ = _shown  # type: ignore[method-assign]  # a dataclass makes none that knows them otherwise

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            own = dict(self.__dict__.get("kind_values", ()))
            if name in own or (not name.startswith("_") and name in _own_parameters(type(self))):
                return own.get(name)
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")


def _shown(part: Any) -> str:
    """A `Kinded` object as it is made, with the parameters of its kinds."""
    values = {one.name: getattr(part, one.name) for one in fields(part) if one.repr} | dict(part.kind_values)
    return f"{type(part).__qualname__}({', '.join(f'{name}={value!r}' for name, value in values.items())})"


def parameters_of(cls: Any) -> Mapping[str, Parameter]:
    """The parameters of a dataclass, by field, and those of kinds that it chooses among, by attribute.

    Returns
    -------
    Mapping[str, Parameter]
        In the order of the fields.
    """
    return _all_parameters(cls, _chosen(cls))


@kept(None)
def _all_parameters(cls: Any, chosen: tuple[tuple[Any, ...], ...]) -> Mapping[str, Parameter]:
    """As `parameters_of`, of fields and the kinds that each of them chooses among."""
    own = _merged(cls, chosen) if issubclass(cls, Kinded) else {}
    return MappingProxyType({**_with_users(_stated_in(cls)), **own})


def _with_users(stated: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Parameters by attribute, those that name a family's choice alone as their condition with the kinds that use
    them."""
    found = dict(stated)
    for chooser, choice in stated.items():
        if not (isinstance(choice, Choice) and choice.family is not None):
            continue
        prefix = choice.family.prefix if chooser == choice.name else ""  # attributes are then named as in a scene
        for name, parameter in stated.items():
            if parameter.when == (chooser,):
                own = name.removeprefix(prefix)
                users = [word for word, kind in choice.family.kinds().items() if own in kind.uses]
                found[name] = replace(parameter, when=(chooser, *users))
    return found


def _own_parameters(cls: Any) -> dict[str, Parameter]:
    """Parameters of all kinds that the choices of a class are among, by attribute.

    One that several kinds share applies to all of them; where their ranges differ, the widest is checked here, and each
    kind checks its own.
    """
    return _merged(cls, _chosen(cls))


def _chosen(cls: Any) -> tuple[tuple[Any, ...], ...]:
    """Of each field of a class that chooses a kind, its name and all kinds that there are now."""
    return tuple((name, *family.kinds().values()) for name, family in _families_of(cls))


@kept(None)
def _families_of(cls: Any) -> tuple[tuple[str, Any], ...]:
    choices = _stated_in(cls).items()
    return tuple((name, one.family) for name, one in choices if isinstance(one, Choice) and one.family is not None)


@kept(None)
def _merged(cls: Any, chosen: tuple[tuple[Any, ...], ...]) -> dict[str, Parameter]:
    """As `_own_parameters`, of fields and the kinds that each of them chooses among."""
    stated = _stated_in(cls)
    merged: dict[str, Parameter] = {}
    for chooser, *kinds in chosen:
        choice: Any = stated[chooser]
        for word, kind in ((kind.name, kind) for kind in kinds):
            for own, parameter in kind.own_parameters().items():
                shown = choice.family.prefix + own  # as in a scene
                name = shown if chooser == choice.name else own
                if name not in stated:
                    one = replace(parameter, name=shown, when=(chooser, word))
                    merged[name] = _shared(merged[name], one) if name in merged else one
                elif word not in stated[name].when:  # else the class states it itself
                    raise TypeError(f"{chooser} {word!r}: {name} is a parameter of {cls.__name__} already.")
    return merged


def _shared(first: Parameter, second: Parameter) -> Parameter:
    """A parameter of two kinds of a family."""
    when = (*first.when, *second.when[1:])
    if replace(second, when=first.when) == first:
        return replace(first, when=when)
    doc = f"{first.doc.removesuffix('.')}; {second.range} for `{second.when[-1]}`."
    wider: dict[str, Any] = (
        {"above": -math.inf, "minimum": -math.inf, "maximum": math.inf} if isinstance(first, Number) else {}
    )
    return replace(first, when=when, doc=doc, **wider)


@kept(None)
def _stated_in(cls: Any) -> Mapping[str, Parameter]:
    stated = {field.name: field.metadata.get("parameter") for field in fields(cls)}
    return MappingProxyType({name: named(one, name) for name, one in stated.items() if one is not None})


def check(part: Any) -> None:
    """Check a frozen dataclass, and set defaults of parameters that were not given.

    Parameters
    ----------
    part : dataclass instance
        Whose fields are parameters.

    Raises
    ------
    InputError
        if a value is missing, not allowed, or of no effect.
    """
    missing = []
    for name, parameter in parameters_of(type(part)).items():
        value = getattr(part, name)
        conflict = parameter.conflict(part)
        if conflict and value is not None:
            raise InputError(conflict)
        if value is None and not conflict and parameter.default is REQUIRED:
            missing.append(parameter)
        elif not conflict and (value is not None or parameter.default is not None):
            given = parameter.default if value is None and parameter.is_conditional else value
            _set(part, name, parameter.checked(given))
    if missing:
        raise InputError(f"{missing[0].name} is missing: {missing[0].needed.replace('finite ', '')}.")


def _set(part: Any, name: str, value: Any) -> None:
    """Set a parameter of a frozen object."""
    cls: Any = type(part)
    if name in _stated_in(cls):
        object.__setattr__(part, name, value)
    else:
        own = dict(part.kind_values) | {name: value}
        object.__setattr__(part, "kind_values", tuple(sorted(own.items())))


def values_of(part: Any) -> dict[str, Any]:
    """The parameters of a part, as entries of a Mitsuba dictionary.

    Parameters
    ----------
    part : dataclass instance
        Whose fields are parameters.

    Returns
    -------
    dict[str, Any]
        Values by name; those that are None are left out.
    """
    values = [(p, getattr(part, name)) for name, p in parameters_of(type(part)).items()]
    return {p.name: _written(p, value) for p, value in values if value is not None}


def _written(parameter: Parameter, value: Any) -> Any:
    if isinstance(parameter, Nested):
        return value.to_dict()
    return list(value) if isinstance(value, tuple) else value


def _specification_of(props: Any, parameter: Nested) -> Any:
    """Specification of a nested object; None if there is none, or it is not a plugin of this package."""
    made = [value for name, value in props.objects() if not parameter.by_name or name == parameter.name]
    found = [getattr(value, "specification", None) for value in made]
    return next((value for value in found if isinstance(value, parameter.made_of)), None)
