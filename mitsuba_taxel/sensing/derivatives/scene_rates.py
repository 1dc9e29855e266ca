"""Rates of change of a scene's parts (load, material, dimensions) with one of its parameters.

The scene is parsed at values of the parameter on both sides of the present value, and the rates are finite differences
of its parts. So a parameter may be used several times, as the pitch of a pad and of its photo-reflectors.
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
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.left_out import NONE
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters
from mitsuba_taxel.sensing.scene.parsing import parser_config
from mitsuba_taxel.sensing.scene.written_scene import COMPONENTS
from mitsuba_taxel.specification import Specification, specifications
from mitsuba_taxel.specification.deformable_pad import FINISHES, DeformablePad
from mitsuba_taxel.specification.photo_reflector import PhotoReflector

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import Material

STEP = 1e-3
"""Step of finite differences, relative to the value of the parameter (to 1 if the value is 0)."""
NOISE = 1e-9
"""Largest rate that counts as a rounding error."""
FINISH_NUMBERS = {parameter.name for kind in FINISHES.values() for parameter in parameters_of(kind).values()}
PAD, PACKAGES = DeformablePad.plugin, PhotoReflector.plugin


def instead_of_derivative(name: str) -> str:
    """Advice for an error message about a parameter that moves a finish. Readings have no derivative with respect to
    it, because they jump if an edge of the finish crosses a light path.
    """
    return f"take a difference of readings, which share their random numbers, by --vary {name}=FROM,TO"


@dataclass(frozen=True)
class Rates:
    """Rates of change of a scene's parts with a parameter, per unit of the parameter.

    Attributes
    ----------
    name, unit : str
        Name and unit of the parameter.
    value : float
        Present value of the parameter.
    load : (components,) ndarray
        Rates of change of the components of the load.
    place : (2,) ndarray
        Rates of change of x and y of a patch or an indenter, in mm.
    material, pad : dict[str, float]
        Rates of change of the constants of the material and of the dimensions of the pad, by name.
    beside : list[tuple[float, float]]
        Terms of a finite difference for the parts of the scene other than pads: weight, and value of the parameter.
        Empty if the parameter does not change these parts.
    at : Callable[[float], mi.Scene]
        Loads the scene with another value of the parameter; the pad, if any, keeps its present value.
    side : int
        Side on which a one-sided derivative is requested, where both sides differ: 1 towards larger values of the
        parameter, -1 towards smaller values, 0 for the mean of both.
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
        """Terms of the finite difference in ``beside``: weight and loaded scene. The scenes are not cached, because
        Dr.Jit's kernels contain the parts of all scenes that are alive."""
        return [(weight, self.at(value)) for weight, value in self.beside]


def rates(scene: Scene, name: str) -> Rates:
    """Compute the rates of change of a scene's parts with one of its parameters.

    Parameters
    ----------
    scene : Scene
        Description of the scene; it need not be loaded.
    name : str
        A ``<default>`` of the scene; a component of the load (fx, fy, fz, ux, uy, uz) or of a point of the profile
        (profile_r1, profile_z1, ...); or a parameter of one of its plugins, preceded by the plugin and a dot if several
        have it.

    Returns
    -------
    Rates
        Rates per unit of the parameter.

    Raises
    ------
    InputError
        if there is no such parameter, if it is not a number, or if readings have no derivative with respect to it.
    """
    config = parser_config(activate_variant())
    refusals = []
    with scene.files_beside_it():
        parameter = _parameter(scene, name, config)
        step = STEP * (abs(parameter.value) or 1.0)
        for stencil in STENCILS:
            try:
                stencil_of_step = [(weight / step, offset * step) for weight, offset in stencil]
                return _differences(scene, parameter, stencil_of_step, config)
            except (InputError, RuntimeError) as error:  # Mitsuba turns exceptions of a plugin into RuntimeError
                refusals.append(error)
    if isinstance(refusals[-1], InputError):
        raise refusals[-1]
    why = "a small change of it is not allowed"
    raise InputError(f"{name} = {parameter.value:g} has no derivative: {why}.") from refusals[-1]


@dataclass(frozen=True)
class _Parameter:
    """A parameter of a scene; ``at`` parses the scene with another value of the parameter."""

    name: str
    unit: str
    value: float
    at: Callable[[float], mi.parser.ParserState]


def _parameter(scene: Scene, name: str, config: mi.parser.ParserConfig) -> _Parameter:
    """Find the parameter with a name: a ``<default>`` of the scene, or else a parameter of one of its plugins."""
    # A <default>: the scene is parsed with another value of it.
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
        return _Parameter(name, unit, value, lambda changed: _parsed(scene, config, {name: repr(changed)}))

    # A number of a plugin, a component of its load, or a dimension that follows from its parameters.
    plugin, _, local_name = name.rpartition(".")
    quantity, index = COMPONENTS.get(local_name, (local_name, None))
    nodes = []
    for number, node in enumerate(_parsed(scene, config, {}).nodes):
        specification = specifications().get(node.props.plugin_name())
        if specification is None or plugin not in ("", specification.plugin):
            continue
        parameter = specification.values().get(quantity)
        if parameter is None and issubclass(specification, DeformablePad):
            derived = _dimensions(specification.read(node.props)).get(local_name)
            if derived is not None:
                nodes.append((number, specification.plugin, "", derived))
        elif isinstance(parameter, Number if index is None else Parameter):
            present = _present(specification.read(node.props), quantity)
            if present is not None:
                value = present if index is None else present[index]
                nodes.append((number, specification.plugin, parameter.unit, value))

    # Exactly one parameter must have this name.
    if not nodes:
        of_scene, of_parts = _numbers_in(scene, config)
        allowed = [f"parameters {', '.join(of_scene)}"] if of_scene else []
        allowed += [f"numbers of its parts {', '.join(of_parts)}"] if of_parts else []
        raise InputError(
            f"{name} has no derivative: it is not a numeric parameter of the scene. Allowed are "
            f"{'; '.join(allowed) or 'none'}."
        )
    if len(nodes) > 1:
        plugins = ", ".join(sorted({plugin for _, plugin, _, _ in nodes}))
        raise InputError(
            f"{name} is ambiguous: {len(nodes)} objects of the scene ({plugins}) have a parameter of this name; "
            "replace it by a <default>."
        )
    ((number, _, unit, value),) = nodes

    def parsed_with(changed: float) -> mi.parser.ParserState:
        state = _parsed(scene, config, {})
        props = state.nodes[number].props
        specification = specifications()[props.plugin_name()]
        if quantity not in specification.values():
            pad = _undeformed(specification.read(props)).changed(**{local_name: changed})
            for parameter in pad.shape.parameters_at(pad.shape.dimensions):
                props[parameter] = getattr(pad, parameter)
        elif index is not None:
            vector = list(_present(specification.read(props), quantity))
            vector[index] = changed
            props[quantity] = mi.ScalarVector3d(*vector)
        else:
            props[quantity] = changed
        return state

    return _Parameter(name, unit or "1", float(value), parsed_with)


def _numbers_in(scene: Scene, config: mi.parser.ParserConfig) -> tuple[list[str], list[str]]:
    """Names of the numerical parameters of a scene, and of numerical parameters that exactly one of its plugins has."""
    of_scene = [name for name, value in scene.parameters.items() if as_numbers([value])]
    times: Counter[str] = Counter()
    for node in _parsed(scene, config, {}).nodes:
        specification = specifications().get(node.props.plugin_name())
        if specification is None:
            continue
        plugin = specification.read(node.props)
        names = set(specification.values())
        if isinstance(plugin, DeformablePad):
            names &= _differentiable(plugin)
        for name in names:
            value, parameter = _present(plugin, name), specification.values()[name]
            if isinstance(parameter, Number) and is_number(value):
                times[name] += 1
            of_load = [component for component, (quantity, _) in COMPONENTS.items() if quantity == name]
            times.update(of_load if value is not None else [])
    return of_scene, sorted(name for name, count in times.items() if count == 1 and name not in of_scene)


def _present(plugin: Specification, name: str) -> Any:
    """Present value of a parameter of a plugin, given or derived from other parameters; None if it has no value."""
    field = next(field for field, parameter in parameters_of(type(plugin)).items() if parameter.name == name)
    value = getattr(plugin, field)
    if not isinstance(plugin, DeformablePad) or value is not None:
        return value
    if name in parameters_of(Pad):
        return None if plugin.filename else getattr(plugin.build_pad(), name)
    return _constants(plugin.build_material()).get(name)


def _dimensions(plugin: DeformablePad) -> Mapping[str, float]:
    """Dimensions of a pad by name, including dimensions that are not parameters, such as points of a profile; empty for
    a pad from a file."""
    return {} if plugin.filename else _undeformed(plugin).dimensions


def _undeformed(plugin: DeformablePad) -> Pad:
    pad = plugin.build_pad()
    assert isinstance(pad, Pad)
    return pad


def _parsed(scene: Scene, config: mi.parser.ParserConfig, changes: dict[str, str]) -> mi.parser.ParserState:
    changed = Scene(scene.source, {**scene.parameters, **changes}, scene.mesh_size) if changes else scene
    return changed.parsed(config)


def _differences(
    scene: Scene, parameter: _Parameter, stencil: list[tuple[float, float]], config: mi.parser.ParserConfig
) -> Rates:
    """Rates as finite differences of parsed scenes, with the weights and offsets of a ``stencil``.

    Raises
    ------
    InputError
        if the parameter changes a property on which readings do not depend smoothly, or if a neighbouring value is not
        allowed.
    """
    base = parameter.at(parameter.value)
    values = [(weight, parameter.value + offset) for weight, offset in stencil]
    states = [(weight, parameter.at(value)) for weight, value in values]
    pad = _pad(base)

    # The pad: its load, the position of the patch or indenter, its material and its dimensions.
    load, place, material, dimensions = np.zeros(0), np.zeros(2), dict[str, float](), dict[str, float]()
    for weight, state in states:
        changed = _pad(state)
        if pad is None or changed is None:
            continue
        _refuse_unsmooth(parameter, pad, changed)
        value = weight * np.array(changed.load_value)
        load = load + value if len(load) else value
        position = Load.named(changed.load).position
        place += weight * np.array([getattr(changed, name) or 0.0 for name in position] or [0.0, 0.0])
        _add(material, weight, _constants(changed.build_material()))
        _add(dimensions, weight, {} if changed.filename else _undeformed(changed).dimensions)

    # All other parts. A value that a plugin does not allow is refused when the scene is loaded.
    beside_pad = any(_without_pad(base) != _without_pad(state) for _, state in states)
    moves_packages = any(_without_pad(base, PACKAGES) != _without_pad(state, PACKAGES) for _, state in states)
    if pad and pad.self_contact and moves_packages:
        raise InputError(
            f"{parameter.name} has no derivative with self_contact, as it moves an object that the pad may touch: "
            f"vary it in a sweep instead."
        )
    for _, state in states if beside_pad else []:
        _with_pad_of(base, state, config)

    def at(value: float) -> mi.Scene:
        with scene.files_beside_it():
            return _with_pad_of(base, parameter.at(value), config)

    return Rates(
        name=parameter.name,
        unit=parameter.unit,
        value=parameter.value,
        load=load,
        place=np.where(np.abs(place) > NOISE, place, 0.0),
        material={name: rate for name, rate in material.items() if abs(rate) > NOISE},
        pad={name: rate for name, rate in dimensions.items() if abs(rate) > NOISE},
        beside=values if beside_pad else [],
        at=at,
    )


def _with_pad_of(base: mi.parser.ParserState, state: mi.parser.ParserState, config: mi.parser.ParserConfig) -> mi.Scene:
    """Load the scene parsed as ``state``, with the pad of the scene parsed as ``base``."""
    for node, node_of_base in zip(state.nodes, base.nodes, strict=True):
        if node.props.plugin_name() == PAD:
            node.props = node_of_base.props
    mi.parser.transform_all(config, state)
    return mi.parser.instantiate(config, state)


def _pad(state: mi.parser.ParserState) -> DeformablePad | None:
    """The deformable pad of a parsed scene; None without one."""
    pads = [node.props for node in state.nodes if node.props.plugin_name() == PAD]
    if not pads:
        return None
    if len(pads) > 1:
        raise InputError(f"derivatives are not available: the scene holds {len(pads)} deformable pads; one is allowed.")
    pad = DeformablePad.read(pads[0])
    if pad.build_prony():
        raise InputError("derivatives are not available: the pad is viscoelastic (prony); sweep over the load instead.")
    if pad.build_mullins():
        raise InputError("derivatives are not available: the pad has Mullins' effect; sweep over the load instead.")
    if pad.friction:
        raise InputError("derivatives are not available: the indenter has friction; sweep over the load instead.")
    return pad


def _refuse_unsmooth(parameter: _Parameter, pad: DeformablePad, changed: DeformablePad) -> None:
    """Raise `InputError` if a parameter changes a property of a pad on which its deformation does not depend
    smoothly."""
    differentiable = _differentiable(pad)
    for name in parameters_of(DeformablePad):
        if name in differentiable or name == "bsdf":
            continue
        values = [getattr(pad, name), getattr(changed, name)]
        if name == "to_world" and values[0] is not None:
            values = [np.array(transform.matrix).tolist() for transform in values]
        if values[0] != values[1]:
            reason = f"it changes {name} of the {PAD}"
            if name in FINISH_NUMBERS:
                reason += f", a number of its finish; {instead_of_derivative(parameter.name)}"
            raise InputError(f"{parameter.name} has no derivative: {reason}.")


def _differentiable(pad: DeformablePad) -> set[str]:
    """Names of the parameters of a pad on which its deformation depends smoothly."""
    load = {"force", "displacement", "pressure", "shore_a", *Load.named(pad.load).position}
    return load | {*parameters_of(Pad), *_constants(pad.build_material())}


def _constants(material: Material) -> dict[str, float]:
    """The constants of a material law, by name."""
    return {name: float(getattr(material, name)) for name in material.parameters}


def _add(total: dict[str, float], weight: float, numbers: dict[str, float]) -> None:
    for name, number in numbers.items():
        total[name] = total.get(name, 0.0) + weight * number


def _without_pad(state: mi.parser.ParserState, plugin: str = "") -> list[dict[str, Any]]:
    """Parameters of all objects of a parsed scene except pads, as values that can be compared. With ``plugin``, only
    objects of this plugin are included."""
    return [
        {name: _value(node.props, name) for name in node.props.keys()}  # noqa: SIM118  (no mapping)
        for node in state.nodes
        if node.props.plugin_name() != PAD and plugin in ("", node.props.plugin_name())
    ]


def _value(props: mi.Properties, name: str) -> Any:
    kind = props.type(name)
    if kind == mi.Properties.Type.Transform:
        return np.array(props[name].matrix).tolist()
    if kind in (mi.Properties.Type.ResolvedReference, mi.Properties.Type.Reference, mi.Properties.Type.Object):
        return None
    value = props[name]
    return value if isinstance(value, (bool, int, float, str)) else np.array(value).tolist()
