"""Mitsuba's parser: its settings, the check of transformations, and the conversion of its errors."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.sensing.scene.left_out import used_by
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file

if TYPE_CHECKING:
    import mitsuba as mi

FURTHEST = 1e8
"""Largest number in a transformation: beyond it, squares of lengths overflow in single precision."""


class Described(Protocol):
    """Interface: attributes of a `Scene` that error messages mention."""

    source: Path | dict[str, Any]
    parameters: dict[str, str]

    @property
    def name(self) -> str: ...


def far_transforms(props: mi.Properties) -> dict[str, str]:
    """Find transformations of an object with numbers that are not allowed, with an error message for each.

    Parameters
    ----------
    props : mi.Properties
        Properties of the object.

    Returns
    -------
    dict[str, str]
        Messages by the name of the transformation.
    """
    import mitsuba as mi
    import numpy as np

    refused = {}
    for name in [name for name in props.keys() if props.type(name) == mi.Properties.Type.Transform]:
        matrix = np.array(props[name].matrix, dtype=float)
        props.mark_queried(name, False)  # so that a plugin that does not know it is still reported
        if not np.all(np.abs(matrix) <= FURTHEST):
            plugin = props.plugin_name()
            refused[name] = f"{name} of {plugin} is not allowed: numbers of at most {FURTHEST:g} are needed"
    return refused


def guilty_parameters(parameters: Mapping[str, str]) -> str:
    """List the scene's parameters whose numbers are not finite or exceed :data:`FURTHEST`, as text for an error
    message.

    Parameters
    ----------
    parameters : Mapping[str, str]
        Parameters of a scene, by name.

    Returns
    -------
    str
        A blank and the names in brackets; empty if there are none.
    """
    guilty = [f"{name} = {value}" for name, value in parameters.items() if not _is_near(value)]
    return f" (parameter {', '.join(guilty)})" if guilty else ""


def _is_near(value: str) -> bool:
    try:
        return abs(float(value)) <= FURTHEST
    except ValueError:
        return True  # a word


def parser_config(variant: str) -> mi.parser.ParserConfig:
    """Settings of Mitsuba's parser.

    Parameters
    ----------
    variant : str
        Variant of Mitsuba.

    Returns
    -------
    mi.parser.ParserConfig
        Settings with which no objects are merged.
    """
    import mitsuba as mi

    config = mi.parser.ParserConfig(variant)
    config.parallel = False  # meshing and solving are not parallel, and slower if they try
    config.merge_meshes = False  # merged meshes lose their names
    config.merge_equivalent = False  # merged emitters cannot be attached to two shapes
    config.unused_parameters = mi.LogLevel.Trace  # `Scene` warns of them
    return config


def as_own_error(error: RuntimeError, scene: Described) -> InputError | ComputationError:
    """Convert the error of a scene that Mitsuba cannot build: the message becomes one line, without traceback or source
    location.

    Parameters
    ----------
    error : RuntimeError
        Error of Mitsuba's parser, or of a plugin that it builds.
    scene : Described
        The scene.

    Returns
    -------
    InputError or ComputationError
        The error to raise instead.

    Raises
    ------
    KeyboardInterrupt
        if an interrupt stopped a plugin, which Mitsuba reports like any other error.
    """
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    if lines[-1].startswith("KeyboardInterrupt"):
        raise KeyboardInterrupt
    name, _, message = lines[-1].partition(": ")
    for kind in (ComputationError, InputError):
        if name in (kind.__name__, *(special.__name__ for special in kind.__subclasses__())):
            return kind(with_own_parameters(message, scene))
    if lines[-1].startswith("MemoryError"):
        return ComputationError(
            f"{scene.name}: there is not enough memory to load it ({lines[-1]}): fewer or "
            f"smaller pads and images need less."
        )
    head = re.sub(r"^\[[^\]]*\] ", "", lines[0]).split(": Traceback")[0]
    tail = lines[-1:] if "Traceback" in lines[0] else [line.lstrip("- ") for line in lines[1:]]
    text = re.sub(r": \[\w+\] ", ": ", " ".join([head, *tail])).rstrip("!")
    text = text.replace("unreferenced property", "unknown parameter").replace(f"{scene.source} ", "")
    unparsed = re.search(r'could not parse \w[\w ]* value "(.*)"', text)
    if unparsed:
        guilty = [name for name, value in scene.parameters.items() if value.strip() == unparsed[1].strip()]
        text += f" (parameter {', '.join(guilty)})" if guilty else ""
    if re.search(r'Plugin "\w+" not found', text):
        text += ": your own are loaded by taxel --plugin FILE.py, or load_plugins in Python"
    return InputError(f"{scene.name}: {text}.")


def with_own_parameters(message: str, scene: Described) -> str:
    """Add to an error message about plugins' parameters the scene's parameters that supply the refused values.

    Parameters
    ----------
    message : str
        Message that shows each refused value as ``name = value``, or begins with the name of the plugin's parameter.
    scene : Described
        The scene. A scene made in Python has no parameters, and its messages are not changed.

    Returns
    -------
    str
        The message, with ``(parameter roof = 1.2)`` before its last full stop if ``$roof`` supplies the refused value.
        A parameter with the same name as the plugin's parameter is not repeated.
    """
    if not isinstance(scene.source, Path):
        return message
    parameters = scene.parameters
    supplying: dict[str, str] = {}
    for element in (element for _, root in read_scene_file(scene.source) for element in root.iter()):
        name, names = element.get("name", ""), used_by(element.attrib)
        if element.tag == "default" or not name or names <= {name}:
            continue
        # The value that Mitsuba reads from the element: a word, a number, or three of them for a vector.
        words = [element.get("value", "")] if "value" in element.attrib else [element.get(axis, "0") for axis in "xyz"]
        value = re.sub(r"\$(\w+)", lambda match: parameters.get(match[1], match[0]), ", ".join(words))
        # "history row '3'" shows one row of the value only: its first word is compared.
        shown = [message[match.end() :] for match in re.finditer(rf"\b{re.escape(name)} = ", message)]
        if any(_begins_with(text, value) for text in shown) or (not shown and message.startswith(f"{name} ")):
            supplying.update({name: parameters[name] for name in sorted(names) if name in parameters})
    pairs = ", ".join(f"{name} = {value}" for name, value in supplying.items())
    return f"{message.removesuffix('.')} (parameter {pairs})." if pairs else message


def _begins_with(text: str, value: str) -> bool:
    """Whether a text begins with a value as messages show it: as a number, a word or a tuple."""
    value = value.strip()
    try:
        numbers = [float(word) for word in re.split(r"[\s,]+", value)]
    except ValueError:
        return bool(value) and text.lstrip("'\"(").startswith(value)
    shown = re.findall(r"[+-]?(?:inf|nan|\d*\.?\d+(?:e[+-]?\d+)?)", text)[: len(numbers)]
    return len(shown) == len(numbers) and all(
        math.isclose(number, float(word), rel_tol=1e-3) or (math.isnan(number) and word == "nan")
        for number, word in zip(numbers, shown, strict=True)
    )
