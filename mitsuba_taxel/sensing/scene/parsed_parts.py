"""Checks of a scene that is parsed but not built; they take milliseconds."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import mitsuba as mi

from mitsuba_taxel.backend import activate_variant
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.parsing import as_own_error, parser_config, with_own_parameters
from mitsuba_taxel.specification import specifications
from mitsuba_taxel.specification.deformable_pad import DeformablePad
from mitsuba_taxel.specification.specification import Specification


def refusal_of(scene: Scene) -> InputError | None:
    """Find the error that a plugin of this package would raise for a scene, without building the scene.

    Parameters
    ----------
    scene : Scene
        Description of the scene; it need not be loaded.

    Returns
    -------
    InputError or None
        The error, which is not raised; None if the plugins accept the scene.
    """
    with scene.files_beside_it():
        try:
            nodes = scene.parsed(parser_config(activate_variant())).nodes
            for specification in (_specification(node, nodes) for node in nodes):
                if isinstance(specification, DeformablePad) and not specification.filename:
                    specification.build_pad()
        except InputError as error:
            return InputError(with_own_parameters(str(error), scene), error.part)
        except RuntimeError as error:  # Mitsuba's own
            return InputError(as_own_error(error, scene))
    return None


class _Props:
    """Properties of a parsed object, with its nested objects in the form that the built object has."""

    def __init__(self, props: mi.Properties, nodes: Sequence[mi.parser.SceneNode]) -> None:
        self._props, self._nodes = props, nodes

    def __contains__(self, name: str) -> bool:
        return name in self._props

    def __getitem__(self, name: str) -> Any:
        return self._props[name]

    def __setitem__(self, name: str, value: Any) -> None:
        self._props[name] = value

    def get(self, name: str) -> object:
        return self._props.get(name)

    def keys(self) -> list[str]:
        return self._props.keys()

    def type(self, name: str) -> mi.Properties.Type:
        return self._props.type(name)

    def objects(self) -> list[tuple[str, SimpleNamespace]]:
        names = [name for name in self._props.keys() if self._props.type(name) == _REFERENCE]  # noqa: SIM118
        nested = ((name, _specification(self._nodes[self._props[name].index()], self._nodes)) for name in names)
        return [(name, SimpleNamespace(specification=specification)) for name, specification in nested]


_REFERENCE = mi.Properties.Type.ResolvedReference


def _specification(node: mi.parser.SceneNode, nodes: Sequence[mi.parser.SceneNode]) -> Specification | None:
    """The Python object of a node; None if it is not a plugin of this package."""
    kind = specifications().get(node.props.plugin_name())
    return None if kind is None else kind.read(_Props(node.props, nodes))
