"""Whether a loaded scene is as it was: all variables of Dr.Jit, and all other values in Python objects of its plugins.

A variable that is held is never written to, and its number not given to another, so that equal numbers mean equal
values. What Mitsuba does not let anyone change, in its own shapes, needs no watch. A scene that holds an object of a
kind that is not known has no state.
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
    """An object whose state is not known."""


class SceneState:
    """The state of a scene and further objects, equal to another if nothing was changed in between.

    Raises
    ------
    UnknownState
        unless LEDs, phototransistors, walls and ``objects`` are of this package, and shapes of it or Mitsuba's own.

    Attributes
    ----------
    variables : list
        Of Dr.Jit, in Python objects.
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
    """What is known of a scene, None if that cannot be told from another one.

    Attributes
    ----------
    state : SceneState or None
        When it was checked.
    points : dict[float, int]
        Points per taxel and replicate for relative errors of the light.
    """

    def __init__(self, state: SceneState | None) -> None:
        self.state = state
        self.points: dict[float, int] = {}


def _known(scene: mi.Scene, plugins: tuple[Any, ...]) -> tuple[Any, ...]:
    shapes = (shape for shape in scene.shapes() if type(shape) not in (mi.Shape, mi.Mesh))
    if not all(map(_is_ours, (*plugins, *walls_of(scene), *shapes))):
        raise UnknownState
    return plugins


class _Collector:
    """What is in objects and in what they hold: variables of Dr.Jit, and other values.

    Arrays of numpy and specifications are left out: kernels use only what was made of them.
    """

    def __init__(self) -> None:
        self.variables: list[Any] = []
        self.constants: list[Hashable] = []
        self._seen: set[int] = set()

    def visit(self, value: Any) -> None:
        """Add what is in an object; raises `UnknownState`."""
        kind = type(value)
        if dr.is_jit_v(kind) or (hasattr(kind, "DRJIT_STRUCT") and kind.__module__ == "mitsuba"):
            self.variables.append(value)
        elif value is None or kind in (bool, int, float, str):
            self.constants.append(value)
        elif isinstance(value, (list, tuple)):
            self.constants.append(len(value))
            for part in value:
                self.visit(part)
        elif kind is dict:
            self.constants.append(tuple(value))
            for part in value.values():
                self.visit(part)
        elif isinstance(value, (np.ndarray, Specification)) or id(value) in self._seen:
            return
        elif not _is_ours(value):
            raise UnknownState
        else:
            self._seen.add(id(value))
            self.constants.append(kind.__qualname__)
            learned = getattr(kind, "LEARNED", ())
            self.visit({name: part for name, part in vars(value).items() if name not in learned})


def _is_scalar_array(value: Any) -> bool:
    """Whether it is a vector of Mitsuba's for sizes and the like, which no path depends on."""
    return dr.is_array_v(value) and not dr.is_jit_v(value)


def _is_ours(value: Any) -> bool:
    return type(value).__module__.startswith("mitsuba_taxel.")
