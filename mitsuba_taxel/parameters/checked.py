"""Dataclasses whose fields are parameters: checked, read from a scene, and written to a scene."""

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
from mitsuba_taxel.base.kinds import annotations_of, changes_of_kinds
from mitsuba_taxel.parameters.parameter import REQUIRED, Choice, Nested, Number, Parameter, named


class _KindArguments(ABCMeta):
    """Metaclass of `Kinded`: constructors accept the parameters of kinds as keyword arguments."""

    def __call__(cls, *arguments: Any, **values: Any) -> Any:
        of_kinds = dict(values.pop("kind_values", ()))
        of_kinds |= {name: values.pop(name) for name in _kind_parameters(cls) if name in values}
        pairs = sorted((name, value) for name, value in of_kinds.items() if value is not None)
        return super().__call__(*arguments, **values, **({"kind_values": tuple(pairs)} if pairs else {}))

    @property
    def __signature__(cls) -> inspect.Signature:
        """Signature for help and editors: the fields, then the parameters of kinds."""
        _, *of_fields = inspect.signature(cls.__init__).parameters.values()  # type: ignore[misc]
        of_kinds = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in _kind_parameters(cls)
        ]
        return inspect.Signature([*(field for field in of_fields if field.name != "kind_values"), *of_kinds])


class Checked:
    """Base of frozen dataclasses whose fields are parameters; values are checked when an object is created.

    A parameter may apply for some values of other parameters only. A parameter that does not apply is None; one that
    applies has its default unless a value is given. Subclasses check conditions between parameters in :meth:`_check`.
    The section ``Parameters`` of their docstrings is made from the fields.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        metadata = {name: value.metadata for name, value in vars(cls).items() if isinstance(value, Field)}
        declared = {name: entry["parameter"] for name, entry in metadata.items() if "parameter" in entry}
        if declared and cls.__doc__:
            declared = _with_users({name: named(parameter, name) for name, parameter in declared.items()})
            types = {name: kind.replace(" | None", ", optional") for name, kind in annotations_of(cls).items()}
            rows = "\n".join(f"{name} : {types[name]}\n    {p.description_with_unit}" for name, p in declared.items())
            head, separator, rest = re.split(r"(\n\n(?:Raises|Notes)\n|$)", inspect.cleandoc(cls.__doc__), maxsplit=1)
            cls.__doc__ = "".join([head, "\n\nParameters\n----------\n", rows.replace("`", "``"), separator, rest])

    def __post_init__(self) -> None:
        check(self)
        self._check()

    def _check(self) -> None:
        """Raise `InputError` for values that are inconsistent with each other."""

    @classmethod
    def read(cls, props: Any) -> Any:
        """Create an object of this class from the values of ``mi.Properties``; raises `InputError`."""
        values = {}
        for attribute, parameter in parameters_of(cls).items():
            if isinstance(parameter, Nested):
                value = _specification_of(props, parameter)
            else:
                value = props.get(parameter.name) if parameter.name in props else None
            if value is not None:
                values[attribute] = value
        return cls(**values)


@dataclass(frozen=True)
class Kinded(Checked, metaclass=_KindArguments):
    """Base of dataclasses with a parameter that names a kind, such as ``cell``, which has further parameters.

    The parameters of the chosen kind are arguments and attributes of the object, like its fields. They are no fields,
    as new kinds may be defined at any time.

    Parameters
    ----------
    kind_values : tuple[tuple[str, Any], ...]
        Names and values of the parameters of kinds, sorted by name; set by passing these parameters as arguments.
    """

    kind_values: tuple[tuple[str, Any], ...] = field(default=(), kw_only=True, repr=False)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # The representation that a dataclass generates lacks the parameters of kinds.
        cls.__repr__ = _shown  # type: ignore[method-assign]

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            of_kinds = dict(self.__dict__.get("kind_values", ()))
            if name in of_kinds or (not name.startswith("_") and name in _kind_parameters(type(self))):
                return of_kinds.get(name)
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")


def _shown(instance: Any) -> str:
    """Text (``repr``) of a `Kinded` object: a call of its class with the parameters of its kinds."""
    values = {entry.name: getattr(instance, entry.name) for entry in fields(instance) if entry.repr} | dict(
        instance.kind_values
    )
    return f"{type(instance).__qualname__}({', '.join(f'{name}={value!r}' for name, value in values.items())})"


def parameters_of(cls: Any) -> Mapping[str, Parameter]:
    """Parameters of a dataclass: those of its fields, and those of all kinds that its fields may name.

    Returns
    -------
    Mapping[str, Parameter]
        Parameters by attribute; fields in their order, then parameters of kinds.
    """
    return _current_parameters(cls, changes_of_kinds())


@kept(1024)
def _current_parameters(cls: Any, _: int) -> Mapping[str, Parameter]:
    """Parameters of a class. The result is kept from call to call, until a kind is added or removed: this changes the
    second argument, a number that only tells kept results apart."""
    return _all_parameters(cls, _chosen(cls))


@kept(None)
def _all_parameters(cls: Any, chosen: tuple[tuple[Any, ...], ...]) -> Mapping[str, Parameter]:
    """Parameters of a class as `parameters_of` returns them, for the kinds that exist now. ``chosen`` is the result of
    `_chosen`."""
    of_kinds = _merged(cls, chosen) if issubclass(cls, Kinded) else {}
    return MappingProxyType({**_with_users(_declared_in(cls)), **of_kinds})


def _with_users(declared: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Parameters by attribute, with complete conditions.

    If the condition of a parameter names the choice of a family but no kinds, the parameter applies to the kinds that
    use it.
    """
    parameters = dict(declared)
    for chooser, choice in declared.items():
        if not (isinstance(choice, Choice) and choice.family is not None):
            continue
        # Attributes have the prefix of the family if they are named as in a scene.
        prefix = choice.family.prefix if chooser == choice.name else ""
        for name, parameter in declared.items():
            if parameter.when == (chooser,):
                key = name.removeprefix(prefix)
                users = [word for word, kind in choice.family.kinds().items() if key in kind.uses]
                parameters[name] = replace(parameter, when=(chooser, *users))
    return parameters


def _kind_parameters(cls: Any) -> dict[str, Parameter]:
    """Parameters of all kinds that a class may choose, by attribute.

    A parameter that several kinds have in common applies to all these kinds. If its range differs between kinds, no
    range is checked here: each kind checks its range.
    """
    return _current_kind_parameters(cls, changes_of_kinds())


@kept(1024)
def _current_kind_parameters(cls: Any, _: int) -> dict[str, Parameter]:
    """Parameters of the kinds of a family, as from `_kind_parameters`. The second argument is the number of
    changes of all kinds so far, so that the cache is renewed after a new kind.
    """
    return _merged(cls, _chosen(cls))


def _chosen(cls: Any) -> tuple[tuple[Any, ...], ...]:
    """For each field of a class that chooses a kind: its name and all kinds of the family that exist now."""
    return tuple((name, *family.kinds().values()) for name, family in _families_of(cls))


@kept(None)
def _families_of(cls: Any) -> tuple[tuple[str, Any], ...]:
    """Name and family of each field of a class that chooses a kind."""
    declared = _declared_in(cls).items()
    return tuple(
        (name, choice.family) for name, choice in declared if isinstance(choice, Choice) and choice.family is not None
    )


@kept(None)
def _merged(cls: Any, chosen: tuple[tuple[Any, ...], ...]) -> dict[str, Parameter]:
    """Parameters of kinds as `_kind_parameters` returns them, for the kinds that exist now. ``chosen`` is the result of
    `_chosen`."""
    declared = _declared_in(cls)
    merged: dict[str, Parameter] = {}
    for chooser, *kinds in chosen:
        choice: Any = declared[chooser]
        for word, kind in ((kind.name, kind) for kind in kinds):
            for key, parameter in kind.own_parameters().items():
                scene_name = choice.family.prefix + key
                name = scene_name if chooser == choice.name else key
                if name not in declared:
                    candidate = replace(parameter, name=scene_name, when=(chooser, word))
                    merged[name] = _shared(merged[name], candidate) if name in merged else candidate
                # A field of the class may be the kind's parameter, if its condition names the kind.
                elif word not in declared[name].when:
                    raise TypeError(f"{chooser} {word!r}: {name} is a parameter of {cls.__name__} already.")
    return merged


def _shared(first: Parameter, second: Parameter) -> Parameter:
    """The common parameter of two kinds of a family: equal in both, or without a range, which each kind then checks."""
    when = (*first.when, *second.when[1:])
    if replace(second, when=first.when) == first:
        return replace(first, when=when)
    doc = f"{first.doc.removesuffix('.')}; {second.range} for `{second.when[-1]}`."
    wider: dict[str, Any] = (
        {"above": -math.inf, "minimum": -math.inf, "maximum": math.inf} if isinstance(first, Number) else {}
    )
    return replace(first, when=when, doc=doc, **wider)


@kept(None)
def _declared_in(cls: Any) -> Mapping[str, Parameter]:
    """Parameters that are fields of a class, by field."""
    declared = {field.name: field.metadata.get("parameter") for field in fields(cls)}
    return MappingProxyType(
        {name: named(parameter, name) for name, parameter in declared.items() if parameter is not None}
    )


def check(instance: Any) -> None:
    """Check a frozen dataclass, and set the defaults of parameters without a value.

    Parameters
    ----------
    instance : dataclass instance
        Object whose fields are parameters.

    Raises
    ------
    InputError
        if a value is missing, is not allowed, or has no effect.
    """
    missing = []
    for name, parameter in parameters_of(type(instance)).items():
        value = getattr(instance, name)
        conflict = parameter.conflict(instance)
        if conflict and value is not None:
            raise InputError(conflict)
        if value is None and not conflict and parameter.default is REQUIRED:
            missing.append(parameter)
        elif not conflict and (value is not None or parameter.default is not None):
            effective = parameter.default if value is None and parameter.is_conditional else value
            _set(instance, name, parameter.checked(effective))
    if missing:
        raise InputError(f"{missing[0].name} is missing: {missing[0].needed.replace('finite ', '')}.")


def _set(instance: Any, name: str, value: Any) -> None:
    """Set a parameter of a frozen object, a field or a parameter of a kind."""
    cls: Any = type(instance)
    if name in _declared_in(cls):
        object.__setattr__(instance, name, value)
    else:
        of_kinds = dict(instance.kind_values) | {name: value}
        object.__setattr__(instance, "kind_values", tuple(sorted(of_kinds.items())))


def values_of(instance: Any) -> dict[str, Any]:
    """Values of the parameters of an object, as entries of a Mitsuba dictionary.

    Parameters
    ----------
    instance : dataclass instance
        Object whose fields are parameters.

    Returns
    -------
    dict[str, Any]
        Values by name, without parameters that are None.
    """
    entries: dict[str, Any] = {}
    for name, parameter in parameters_of(type(instance)).items():
        value = getattr(instance, name)
        if isinstance(parameter, Nested) and value is not None:
            entries[parameter.name] = value.to_dict()
        elif value is not None:
            entries[parameter.name] = list(value) if isinstance(value, tuple) else value
    return entries


def _specification_of(props: Any, parameter: Nested) -> Any:
    """Specification of a nested object; None without such an object, or if its plugin is not of this package."""
    objects = [value for name, value in props.objects() if not parameter.by_name or name == parameter.name]
    specifications = [getattr(value, "specification", None) for value in objects]
    return next((value for value in specifications if isinstance(value, parameter.made_of)), None)
