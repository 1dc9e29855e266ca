"""State of a loaded scene: all variables of Dr.Jit, and all other values in the Python objects of its plugins.

Two states are equal if nothing was changed in between. A variable with a reference is never written to, and its index
is not reused, so that equal indices mean equal values. Values in Mitsuba's own shapes that cannot be changed are not
recorded. A scene with an object of an unknown kind has no state.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.walls import walls_of
from mitsuba_taxel.specification.specification import Specification


class UnknownState(Exception):
    """The state of a scene cannot be recorded, because it has an object of an unknown kind."""


class SceneState:
    """State of a scene and of additional objects: two states are equal if nothing has changed between them.

    Raises
    ------
    UnknownState
        unless LEDs, phototransistors, walls and ``objects`` are of this package, and shapes of this package or of
        Mitsuba.

    Attributes
    ----------
    variables : list
        Variables of Dr.Jit in Python objects.
    """

    def __init__(self, scene: mi.Scene, *objects: Any) -> None:
        plugins = (*scene.emitters(), *scene.sensors(), *(shape.bsdf() for shape in scene.shapes()))
        inside, exposed = _Collector(), _Collector()
        inside.visit((_known(scene, plugins), objects))
        exposed.visit([value for _, value in mi.traverse(scene) if not _is_scalar_array(value)])
        self.variables = inside.variables
        self._held = dr.copy([inside.variables, exposed.variables])
        self._key = dr.detail.collect_indices(self._held), inside.constants, exposed.constants

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SceneState) and self._key == other._key

    __hash__ = None  # type: ignore[assignment]


class KnownScene:
    """Cached properties of a scene, with the state of the scene for which they are valid.

    Attributes
    ----------
    state : SceneState or None
        State of the scene for which they are valid; None if the state is unknown.
    points : dict[float, int]
        Points per taxel and replicate that reach a relative error of the light, by that error.
    """

    def __init__(self, state: SceneState | None) -> None:
        self.state = state
        self.points: dict[float, int] = {}


def _known(scene: mi.Scene, plugins: tuple[Any, ...]) -> tuple[Any, ...]:
    """Check that all plugins are of this package, and return them; raises `UnknownState` if a plugin, wall or shape is
    of another package."""
    shapes = (shape for shape in scene.shapes() if type(shape) not in (mi.Shape, mi.Mesh))
    if not all(map(_is_ours, (*plugins, *walls_of(scene), *shapes))):
        raise UnknownState
    return plugins


class _Collector:
    """Collects the variables of Dr.Jit and the other values in objects and, recursively, in their attributes.

    Arrays of numpy and specifications are left out: kernels only use variables that were derived from them.
    """

    def __init__(self) -> None:
        self.variables: list[Any] = []
        self.constants: list[Hashable] = []
        self._seen: set[int] = set()

    def visit(self, value: Any) -> None:
        """Record all variables and values in an object; raises `UnknownState` for an unknown kind of object."""
        kind = type(value)
        if dr.is_jit_v(kind) or (hasattr(kind, "DRJIT_STRUCT") and kind.__module__ == "mitsuba"):
            self.variables.append(value)
        elif value is None or kind in (bool, int, float, str):
            self.constants.append(value)
        elif isinstance(value, (list, tuple)):
            self.constants.append(len(value))
            for item in value:
                self.visit(item)
        elif kind is dict:
            self.constants.append(tuple(value))
            for item in value.values():
                self.visit(item)
        elif isinstance(value, (np.ndarray, Specification)) or id(value) in self._seen:
            return
        elif not _is_ours(value):
            raise UnknownState
        else:
            self._seen.add(id(value))
            self.constants.append(kind.__qualname__)
            learned = getattr(kind, "LEARNED", ())
            self.visit({name: item for name, item in vars(value).items() if name not in learned})


def _is_scalar_array(value: Any) -> bool:
    """Whether a value is a vector of scalars, such as a size. No light path depends on such a value."""
    return dr.is_array_v(value) and not dr.is_jit_v(value)


def _is_ours(value: Any) -> bool:
    """Whether the class of a value is defined in this package."""
    return type(value).__module__.startswith("mitsuba_taxel.")
