"""Base class of the specifications of plugins."""

from __future__ import annotations

from typing import Any, ClassVar

from mitsuba_taxel.parameters import Checked, Nested, Parameter, parameters_of, values_of


class Specification(Checked):
    """Base of the classes that state the parameters of a plugin."""

    plugin: ClassVar[str]
    """Its name in a scene."""
    nested: ClassVar[tuple[Nested, ...]] = ()
    """Objects that may be nested in it, but are not part of the Python object."""
    DRJIT_STRUCT: ClassVar[dict[str, type]] = {}
    """Dr.Jit looks for variables in plugins, but not in here, where there are none."""

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
