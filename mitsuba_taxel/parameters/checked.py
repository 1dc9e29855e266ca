"""Dataclasses whose fields are parameters: checked, read from a scene, and written to one."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import Field, fields
from functools import cache
from types import MappingProxyType
from typing import Any

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters.parameter import REQUIRED, Nested, Parameter, named


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
        for field, parameter in parameters_of(cls).items():
            if isinstance(parameter, Nested):
                value = _specification_of(props, parameter)
            else:
                value = props.get(parameter.name) if parameter.name in props else None
            if value is not None:
                given[field] = value
        return cls(**given)


def parameters_of(cls: Any) -> Mapping[str, Parameter]:
    """The parameters of a dataclass, by field."""
    return _stated_in(cls)


@cache
def _stated_in(cls: Any) -> Mapping[str, Parameter]:
    stated = {field.name: field.metadata.get("parameter") for field in fields(cls)}
    return MappingProxyType({name: named(one, name) for name, one in stated.items() if one is not None})


def check(part: Any) -> None:
    """Check a frozen dataclass, and set defaults of parameters that were not given; raises `InputError`."""
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
            object.__setattr__(part, name, parameter.checked(given))
    if missing:
        raise InputError(f"{missing[0].name} is missing: {missing[0].needed.replace('finite ', '')}.")


def values_of(part: Any) -> dict[str, Any]:
    """The parameters of a part, as entries of a Mitsuba dictionary."""
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
