"""Rates of the parts of a scene with one of its parameters.

The scene is loaded at values on both sides of the parameter's own, and the rates follow from differences of its parts.
A parameter may thus occur several times, such as the pitch of a pad and of its photo-reflectors.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import activate_variant
from mitsuba_taxel.base.arguments import as_numbers, is_number
from mitsuba_taxel.base.differences import STENCILS
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.parameters import Number, Parameter, parameters_of
from mitsuba_taxel.sensing.scene.description import Scene, parser_config
from mitsuba_taxel.sensing.scene.left_out import NONE
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters
from mitsuba_taxel.sensing.scene.written_scene import COMPONENTS
from mitsuba_taxel.specification import Specification, specifications
from mitsuba_taxel.specification.deformable_pad import DeformablePad
from mitsuba_taxel.specification.photo_reflector import PhotoReflector

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import Material

STEP = 1e-3
"""Step relative to a parameter, or to 1 if it is 0."""
NOISE = 1e-9
"""Rates due to rounding."""
PAD, PACKAGES = DeformablePad.plugin, PhotoReflector.plugin


@dataclass(frozen=True)
class Rates:
    """Rates of parts with a parameter, per its unit.

    Attributes
    ----------
    name, unit : str
        Of the parameter.
    value : float
        Of the parameter.
    load : (components,) ndarray
        Of the load's value.
    place : (2,) ndarray
        Of x and y of a patch or an indenter.
    material, pad : dict[str, float]
        Of the parameters of the material, and of the dimensions of the pad.
    beside : list[tuple[float, float]]
        Weights of values of the parameter in a difference, for changes of other parts; empty if they do not change.
    at : Callable[[float], mi.Scene]
        The scene with another value of the parameter, with the pad of the present one, if it has any.
    side : int
        Side of a kink on which derivatives are wanted: 1 with a larger, -1 with a smaller parameter, 0 if on neither.
    """

    name: str
    unit: str
    value: float
    load: np.ndarray
    place: np.ndarray
    material: dict[str, float]
    pad: dict[str, float]
    beside: list[tuple[float, float]]
    at: Callable[[float], mi.Scene]
    side: int = 0

    def scenes(self) -> list[tuple[float, mi.Scene]]:
        """Weights of scenes in a difference, loaded anew: while one is alive, all kernels contain its parts."""
        return [(weight, self.at(value)) for weight, value in self.beside]


def rates(scene: Scene, name: str) -> Rates:
    """Rates of the parts of ``scene`` with its parameter ``name``.

    Parameters
    ----------
    name : str
        A ``<default>`` of the scene; a component of the load (fx, fy, fz, ux, uy, uz) or of a point of the profile
        (profile_r1, profile_z1, ...); or a parameter of one of its plugins, preceded by the plugin and a dot if several
        have it.

    Raises
    ------
    InputError
        if there is no such parameter, it is not a number, or has no derivative.
    """
    config = parser_config(activate_variant())
    refusals = []
    with scene.files_beside_it():
        parameter = _found(scene, name, config)
        step = STEP * (abs(parameter.value) or 1.0)
        for stencil in STENCILS:
            try:
                stencil_of_step = [(weight / step, offset * step) for weight, offset in stencil]
                return _differences(scene, parameter, stencil_of_step, config)
            except (InputError, RuntimeError) as error:  # Mitsuba turns exceptions of a plugin into RuntimeError
                refusals.append(error)
    if isinstance(refusals[-1], InputError):
        raise refusals[-1]
    raise InputError(f"{name} = {parameter.value:g} has no derivative: it cannot change a little.") from refusals[-1]


@dataclass(frozen=True)
class _Parameter:
    """A parameter of a scene, and the scene as Mitsuba parses it with another value."""

    name: str
    unit: str
    value: float
    at: Callable[[float], mi.parser.ParserState]


def _found(scene: Scene, name: str, config: mi.parser.ParserConfig) -> _Parameter:
    if name in scene.parameters:
        text = scene.parameters[name]
        assert isinstance(scene.source, Path)
        unit = units_of_parameters(scene.source).get(name, "1")
        if text == NONE:  # nothing depends on it
            return _Parameter(name, unit, 0.0, lambda _: scene.parsed(config))
        try:
            value = float(text)
        except ValueError:
            raise InputError(f"{name} = {text!r} has no derivative: it is not a number.") from None
        return _Parameter(name, unit, value, lambda other: _parsed(scene, config, {name: repr(other)}))
    plugin, _, own = name.rpartition(".")
    quantity, index = COMPONENTS.get(own, (own, None))
    nodes = []
    for number, node in enumerate(_parsed(scene, config, {}).nodes):
        stated = specifications().get(node.props.plugin_name())
        if stated is None or plugin not in ("", stated.plugin):
            continue
        parameter = stated.values().get(quantity)
        if parameter is None and issubclass(stated, DeformablePad):
            derived = _dimensions(stated.read(node.props)).get(own)
            if derived is not None:
                nodes.append((number, stated.plugin, "", derived))
        elif isinstance(parameter, Number if index is None else Parameter):
            present = _present(stated.read(node.props), quantity)
            if present is not None:
                nodes.append((number, stated.plugin, parameter.unit, present if index is None else present[index]))
    if not nodes:
        of_scene, of_parts = _numbers_in(scene, config)
        allowed = [f"parameters {', '.join(of_scene)}"] if of_scene else []
        allowed += [f"numbers of its parts {', '.join(of_parts)}"] if of_parts else []
        raise InputError(
            f"{name} has no derivative: it is no number of the scene, which has {'; '.join(allowed) or 'none'}."
        )
    if len(nodes) > 1:
        parts = ", ".join(sorted({plugin for _, plugin, _, _ in nodes}))
        raise InputError(f"{name} stands for {len(nodes)} parameters of the scene, of {parts}: give it a <default>.")
    ((number, _, unit, value),) = nodes

    def changed(other: float) -> mi.parser.ParserState:
        state = _parsed(scene, config, {})
        props = state.nodes[number].props
        stated = specifications()[props.plugin_name()]
        if quantity not in stated.values():
            pad = _undeformed(stated.read(props)).changed(**{own: other})
            for parameter in pad.shape.parameters_at(pad.shape.dimensions):
                props[parameter] = getattr(pad, parameter)
        elif index is not None:
            vector = list(_present(stated.read(props), quantity))
            vector[index] = other
            props[quantity] = mi.ScalarVector3d(*vector)
        else:
            props[quantity] = other
        return state

    return _Parameter(name, unit or "1", float(value), changed)


def _numbers_in(scene: Scene, config: mi.parser.ParserConfig) -> tuple[list[str], list[str]]:
    """Names of the parameters of a scene that are numbers, and of the numbers of its parts beside them that stand for
    one of them alone."""
    own = [name for name, value in scene.parameters.items() if as_numbers([value])]
    times: Counter[str] = Counter()
    for node in _parsed(scene, config, {}).nodes:
        stated = specifications().get(node.props.plugin_name())
        if stated is None:
            continue
        part = stated.read(node.props)
        followed = {name for name in stated.values() if not isinstance(part, DeformablePad) or name in _followed(part)}
        for name in followed:
            value, parameter = _present(part, name), stated.values()[name]
            if isinstance(parameter, Number) and is_number(value):
                times[name] += 1
            of_load = [component for component, (quantity, _) in COMPONENTS.items() if quantity == name]
            times.update(of_load if value is not None else [])
    return own, sorted(name for name, count in times.items() if count == 1 and name not in own)


def _present(part: Specification, name: str) -> Any:
    """Value of a parameter of a part, None if unset; also of one that follows from others."""
    field = next(field for field, parameter in parameters_of(type(part)).items() if parameter.name == name)
    value = getattr(part, field)
    if not isinstance(part, DeformablePad) or value is not None:
        return value
    if name in parameters_of(Pad):
        return None if part.filename else getattr(part.build_pad(), name)
    return _numbers(part.build_material()).get(name)


def _dimensions(part: DeformablePad) -> Mapping[str, float]:
    """Dimensions of a pad, also such as are no parameters, as the points of a profile; none of a file."""
    return {} if part.filename else _undeformed(part).dimensions


def _undeformed(part: DeformablePad) -> Pad:
    pad = part.build_pad()
    assert isinstance(pad, Pad)
    return pad


def _parsed(scene: Scene, config: mi.parser.ParserConfig, changes: dict[str, str]) -> mi.parser.ParserState:
    given = Scene(scene.source, {**scene.parameters, **changes}, scene.mesh_size) if changes else scene
    return given.parsed(config)


def _differences(
    scene: Scene, parameter: _Parameter, stencil: list[tuple[float, float]], config: mi.parser.ParserConfig
) -> Rates:
    base = parameter.at(parameter.value)
    values = [(weight, parameter.value + offset) for weight, offset in stencil]
    states = [(weight, parameter.at(value)) for weight, value in values]
    pad = _pad(base)
    load, place, material, dimensions = np.zeros(0), np.zeros(2), dict[str, float](), dict[str, float]()
    for weight, state in states:
        other = _pad(state)
        if pad is None or other is None:
            continue
        _refuse_what_else_changes(parameter, pad, other)
        value = weight * np.array(other.load_value)
        load = load + value if len(load) else value
        position = Load.named(other.load).position
        place += weight * np.array([getattr(other, name) or 0.0 for name in position] or [0.0, 0.0])
        _add(material, weight, _numbers(other.build_material()))
        _add(dimensions, weight, {} if other.filename else _undeformed(other).dimensions)
    others_change = any(_others(base) != _others(state) for _, state in states)
    if pad and pad.self_contact and any(_others(base, PACKAGES) != _others(state, PACKAGES) for _, state in states):
        raise InputError(f"{parameter.name} has no derivative with self_contact: it moves what the pad may touch.")
    for _, state in states if others_change else []:
        _with_pad_of(base, state, config)  # refuses values that a part does not allow

    def at(value: float) -> mi.Scene:
        with scene.files_beside_it():
            return _with_pad_of(base, parameter.at(value), config)

    return Rates(
        parameter.name,
        parameter.unit,
        parameter.value,
        load,
        np.where(np.abs(place) > NOISE, place, 0.0),
        {name: rate for name, rate in material.items() if abs(rate) > NOISE},
        {name: rate for name, rate in dimensions.items() if abs(rate) > NOISE},
        values if others_change else [],
        at,
    )


def _with_pad_of(base: mi.parser.ParserState, state: mi.parser.ParserState, config: mi.parser.ParserConfig) -> mi.Scene:
    """The scene that Mitsuba parsed as ``state``, loaded with the pad of ``base``."""
    for node, before in zip(state.nodes, base.nodes, strict=True):
        if node.props.plugin_name() == PAD:
            node.props = before.props
    mi.parser.transform_all(config, state)
    return mi.parser.instantiate(config, state)


def _pad(state: mi.parser.ParserState) -> DeformablePad | None:
    """The deformable pad of a scene, if it has one."""
    pads = [node.props for node in state.nodes if node.props.plugin_name() == PAD]
    if not pads:
        return None
    if len(pads) > 1:
        raise InputError(f"derivatives are not available: the scene holds {len(pads)} deformable pads; allowed is one.")
    pad = DeformablePad.read(pads[0])
    if pad.prony:
        raise InputError("derivatives are not available: the pad is viscoelastic (prony); vary the steps of the load.")
    if pad.friction:
        raise InputError("derivatives are not available: the indenter has friction; steps of the load are needed.")
    return pad


def _refuse_what_else_changes(parameter: _Parameter, pad: DeformablePad, other: DeformablePad) -> None:
    followed = _followed(pad)
    for name in parameters_of(DeformablePad):
        if name in followed or name == "bsdf":
            continue
        one, two = getattr(pad, name), getattr(other, name)
        if name == "to_world" and one is not None:
            one, two = np.array(one.matrix).tolist(), np.array(two.matrix).tolist()
        if one != two:
            raise InputError(f"{parameter.name} has no derivative: it changes {name} of the {PAD}.")


def _followed(pad: DeformablePad) -> set[str]:
    """Names of the parameters of a pad on which states depend smoothly."""
    load = {"force", "displacement", "pressure", "shore_a", *Load.named(pad.load).position}
    return load | {*parameters_of(Pad), *_numbers(pad.build_material())}


def _numbers(part: Material) -> dict[str, float]:
    """The constants of a material."""
    return {name: float(getattr(part, name)) for name in part.parameters}


def _add(total: dict[str, float], weight: float, numbers: dict[str, float]) -> None:
    for name, number in numbers.items():
        total[name] = total.get(name, 0.0) + weight * number


def _others(state: mi.parser.ParserState, kind: str = "") -> list[dict[str, Any]]:
    """Parameters of each part except the pad, or of those of a kind, as comparable values."""
    return [
        {name: _value(node.props, name) for name in node.props.keys()}  # noqa: SIM118  (no mapping)
        for node in state.nodes
        if node.props.plugin_name() != PAD and kind in ("", node.props.plugin_name())
    ]


def _value(props: mi.Properties, name: str) -> Any:
    kind = props.type(name)
    if kind == mi.Properties.Type.Transform:
        return np.array(props[name].matrix).tolist()
    if kind in (mi.Properties.Type.ResolvedReference, mi.Properties.Type.Reference, mi.Properties.Type.Object):
        return None
    value = props[name]
    return value if isinstance(value, (bool, int, float, str)) else np.array(value).tolist()
