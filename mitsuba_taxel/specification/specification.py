"""Base class of the specifications of plugins."""

from __future__ import annotations

from typing import Any, ClassVar

from mitsuba_taxel.backend import plugin_kind
from mitsuba_taxel.base.errors import InputError, did_you_mean
from mitsuba_taxel.parameters import Checked, Nested, Parameter, parameters_of, values_of


class Specification(Checked):
    """Base class of the plugins' parameters: each subclass declares the parameters of one plugin."""

    plugin: ClassVar[str]
    """Name of the plugin in a scene."""
    nested: ClassVar[tuple[Nested, ...]] = ()
    """Objects that may be nested in the plugin, but are not fields of the Python object."""
    DRJIT_STRUCT: ClassVar[dict[str, type]] = {}
    """Prevents Dr.Jit from searching specifications for variables: they have none."""

    @classmethod
    def read(cls, props: Any) -> Any:
        """Create an object with the values of ``mi.Properties``.

        Raises
        ------
        InputError
            if a value is not allowed, or if a value or a nested object is :meth:`unknown`.
        """
        for message in cls.unknown(props).values():
            raise InputError(message)
        return super().read(props)

    @classmethod
    def unknown(cls, props: Any) -> dict[str, str]:
        """Error messages for values and nested objects that the plugin does not know, by name.

        Mitsuba refuses only properties that no code has queried. Its base classes query more properties than these
        plugins use, such as ``flip_normals`` or a texture. Media in shapes, emitters and sensors are left to
        `refuse_unmodelled`.
        """
        from mitsuba_taxel.backend.plugin_objects import element_of, is_nested

        values, kinds = cls.values(), {nested.kind for nested in cls.objects()} | {""}
        if plugin_kind(cls.plugin) in ("shape", "emitter", "sensor"):
            kinds.add("medium")
        names = [name for name in props.keys() if not is_nested(props, name)]  # noqa: SIM118
        refused = {name: cls.unknown_value(name) for name in names if name not in values}
        for name, nested_object in props.objects():
            if element_of(nested_object) not in kinds:
                refused[name] = (
                    f"{cls.plugin} has no use for the <{element_of(nested_object)}> nested in it: take it out."
                )
        return refused

    @classmethod
    def unknown_value(cls, name: str) -> str:
        """The error message for a parameter that the plugin does not know."""
        by_name = [nested.name for nested in cls.objects() if nested.by_name]
        return f"{name} is no parameter of {cls.plugin}{did_you_mean(name, (*cls.values(), *by_name))}."

    def to_dict(self) -> dict[str, Any]:
        """The plugin as a Mitsuba dictionary, including default values."""
        return {"type": self.plugin, **values_of(self)}

    @classmethod
    def values(cls) -> dict[str, Parameter]:
        """Parameters other than nested objects: numbers, words, vectors and transformations, by name."""
        parameters = parameters_of(cls).values()
        return {parameter.name: parameter for parameter in parameters if not isinstance(parameter, Nested)}

    @classmethod
    def objects(cls) -> list[Nested]:
        """The parameters of objects that may be nested in the plugin."""
        return [parameter for parameter in cls.table() if isinstance(parameter, Nested)]

    @classmethod
    def table(cls) -> tuple[Parameter, ...]:
        """All parameters of the plugin in the order of its table: values first, then nested objects."""
        return (*parameters_of(cls).values(), *cls.nested)
