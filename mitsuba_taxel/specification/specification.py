"""Base class of the specifications of plugins."""

from __future__ import annotations

from typing import Any, ClassVar

from mitsuba_taxel.backend import plugin_kind
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.spelling import did_you_mean
from mitsuba_taxel.parameters import Checked, Nested, Parameter, parameters_of, values_of


class Specification(Checked):
    """Base of the classes that state the parameters of a plugin."""

    plugin: ClassVar[str]
    """Its name in a scene."""
    nested: ClassVar[tuple[Nested, ...]] = ()
    """Objects that may be nested in it, but are not part of the Python object."""
    DRJIT_STRUCT: ClassVar[dict[str, type]] = {}
    """Dr.Jit looks for variables in plugins, but not in here, where there are none."""

    @classmethod
    def read(cls, props: Any) -> Any:
        """An object with the values of ``mi.Properties``.

        Raises
        ------
        InputError
            if a value is not allowed, or one or a nested object is :meth:`unknown`.
        """
        for message in cls.unknown(props).values():
            raise InputError(message)
        return super().read(props)

    @classmethod
    def unknown(cls, props: Any) -> dict[str, str]:
        """Error messages for values and nested objects that the plugin does not know, by name.

        Mitsuba refuses only what nothing has asked for, and its base classes ask for more than our plugins follow, such
        as ``flip_normals`` or a texture. Media in what has an inside are left to `refuse_unmodelled`.
        """
        from mitsuba_taxel.backend.plugin_objects import element_of, is_nested

        known, kinds = cls.values(), {nested.kind for nested in cls.objects()} | {""}
        if plugin_kind(cls.plugin) in ("shape", "emitter", "sensor"):
            kinds.add("medium")
        names = [name for name in props.keys() if not is_nested(props, name)]  # noqa: SIM118
        refused = {name: cls.unknown_value(name) for name in names if name not in known}
        for name, made in props.objects():
            if element_of(made) not in kinds:
                refused[name] = f"{cls.plugin} has no use for the <{element_of(made)}> nested in it: take it out."
        return refused

    @classmethod
    def unknown_value(cls, name: str) -> str:
        """The error message for a value that the plugin does not know."""
        named = [nested.name for nested in cls.objects() if nested.by_name]
        return f"{name} is no parameter of {cls.plugin}{did_you_mean(name, (*cls.values(), *named))}."

    def to_dict(self) -> dict[str, Any]:
        """The plugin as a Mitsuba dictionary, with defaults written out."""
        return {"type": self.plugin, **values_of(self)}

    @classmethod
    def values(cls) -> dict[str, Parameter]:
        """Its numbers, words, vectors and transformations, by name."""
        return {p.name: p for p in parameters_of(cls).values() if not isinstance(p, Nested)}

    @classmethod
    def objects(cls) -> list[Nested]:
        """Objects that may be nested in it."""
        return [p for p in cls.table() if isinstance(p, Nested)]

    @classmethod
    def table(cls) -> tuple[Parameter, ...]:
        """All parameters and nested objects."""
        return (*parameters_of(cls).values(), *cls.nested)
