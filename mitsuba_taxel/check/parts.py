"""The parts of a scene, created one by one to collect the errors of each; pads are read, but not deformed."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import found
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.check.document import KINDS, Element, filled_in
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.pads import extents_in_file, refuse_finish
from mitsuba_taxel.check.parameters import error_in, error_in_plugin
from mitsuba_taxel.kernels.pad_limits import LEAST_FACES, check_mirrors, check_triangles, mirrors
from mitsuba_taxel.pads import PadFile
from mitsuba_taxel.pads.parametric.meshing import check_room
from mitsuba_taxel.sensing.scene.description import NESTED_SCENE, far_transforms, guilty_parameters
from mitsuba_taxel.sensing.scene.nested_parts import unused_parts
from mitsuba_taxel.specification import specifications
from mitsuba_taxel.specification.deformable_pad import DeformablePad

PAD = "deformable_pad"


class UndeformedPad:
    """A pad as described by a scene.

    Attributes
    ----------
    specification : DeformablePad
        Its parameters.
    pad, material : Pad or PadFile, Material
        As for `load_path`.
    load : tuple[Load, tuple[float, ...]]
        The load and its value.
    read_cells : tuple[int, ...] or None
        Numbers of the cells that are read, None for all.
    to_world : (4, 4) ndarray
        From the pad's frame, in mm.
    objects : dict[str, object]
        Nested objects, by name.
    extent, cell_boxes : (2, 3) ndarray, (K, 2, 3) ndarray, or None
        Lowest and highest coordinates of a pad from a file, and of its cells, in the pad's frame.
    """

    extent: np.ndarray | None = None
    cell_boxes: np.ndarray | None = None

    def __init__(self, props: Any) -> None:
        self.specification = stated = DeformablePad.read(props)
        self.pad = stated.build_pad(found)
        self.material = stated.build_material()
        self.load = stated.build_load(found)
        self.read_cells = stated.cell_numbers()
        self.to_world = np.eye(4) if stated.to_world is None else np.array(stated.to_world.matrix, dtype=float)
        self.objects = dict(props.objects())

    # Interface of shapes for `refuse_unmodelled`

    state = None

    def bsdf(self) -> Any:
        return next((made for made in self.objects.values() if isinstance(made, mi.BSDF)), None)

    def interior_medium(self) -> Any:
        return self.objects.get("interior")

    def exterior_medium(self) -> Any:
        return self.objects.get("exterior")


@dataclass
class ScenePart:
    """One object of a scene.

    Attributes
    ----------
    plugin, kind : str
        Its plugin's name, and the name of the element.
    element : Element
        Its element in the file.
    props : Any
        Parameters of the plugin, without nested objects.
    children : dict[str, ScenePart]
        Objects nested in it, by name.
    made : Any
        The object, an `UndeformedPad` for a pad; None if it cannot be made.
    sound : bool
        Whether it was made exactly as described.
    """

    plugin: str
    kind: str
    element: Element
    props: Any
    children: dict[str, ScenePart]
    made: Any = None
    sound: bool = False

    def finding(self, severity: str, message: str, name: str = "") -> Finding:
        """A finding at a parameter, or at the object itself."""
        for child in self.element.children:
            if name and child.attributes.get("name") == name:
                return child.finding(severity, message)
        return self.element.finding(severity, message)

    def nested(self, kind: str) -> list[ScenePart]:
        """The objects of one kind nested in it."""
        return [child for child in self.children.values() if child.kind == kind]


@dataclass
class Parts:
    """All objects of a scene file: those at top level, and all including nested ones."""

    file: str
    roots: list[ScenePart]
    all: list[ScenePart]
    findings: list[Finding]

    @property
    def sound(self) -> bool:
        """Whether all objects were made as the scene describes them."""
        return all(part.sound for part in self.all)

    def of(self, *plugins: str) -> list[ScenePart]:
        """Sound objects of some plugins."""
        return [part for part in self.all if part.sound and part.plugin in plugins]

    def shapes(self) -> list[ScenePart]:
        """Sound shapes at the top level of the scene."""
        return [part for part in self.roots if part.sound and part.kind == "shape"]


def make_parts(state: Any, root: Element, parameters: Mapping[str, str]) -> Parts:
    """Make the objects of a scene that Mitsuba has parsed, and collect the errors of their plugins."""
    maker = _Maker(state, root, parameters)
    scene = maker.part(0)
    everything = [part for part in maker.parts.values() if part is not scene]
    return Parts(root.file.name, list(scene.children.values()), everything, maker.findings)


class _Maker:
    """Makes each object once, nested ones first."""

    def __init__(self, state: Any, root: Element, parameters: Mapping[str, str]) -> None:
        self.state, self.root, self.parameters = state, root, parameters
        self.places = {(element.file.resolve(), element.offset): element for element in root.walk()}
        self.findings: list[Finding] = []
        self.parts: dict[int, ScenePart] = {}

    def part(self, index: int) -> ScenePart:
        """The part of a node of Mitsuba's parser."""
        if index in self.parts:
            return self.parts[index]
        node = self.state.nodes[index]
        props = node.props
        nested = [name for name in props.keys() if props.type(name) == mi.Properties.Type.ResolvedReference]
        children = {name: self.part(props[name].index()) for name in nested}
        element = self.root
        if node.file_index < len(self.state.files):
            file = Path(str(self.state.files[node.file_index])).resolve()
            element = self.places.get((file, node.offset - 1), self.root)
        part = self.parts[index] = ScenePart(props.plugin_name(), element.tag, element, mi.Properties(props), children)
        for name, message in unused_parts(self.state.nodes, node).items():
            if children[name].plugin != PAD:  # see below
                self.findings.append(children[name].finding("error", message))
        if node.type == mi.ObjectType.Scene and index > 0:
            self.findings.append(part.finding("error", NESTED_SCENE))
        elif node.type != mi.ObjectType.Scene:
            before = len(self.findings)
            dropped = self._make(part)
            whole = part.made is not None and not dropped and len(self.findings) == before
            part.sound = whole and all(child.sound for child in children.values())
        return part

    def _make(self, part: ScenePart) -> bool:
        """Make the object of a part, if possible; returns whether parameters already refused were left out."""
        for child in part.children.values():
            if child.plugin == PAD:
                message = f"{PAD} stands in a {part.plugin}: take it out, into the scene itself."
                self.findings.append(child.finding("error", message))
                return False
        if any(child.made is None for child in part.children.values()):
            return False
        if part.element.tag in KINDS and error_in_plugin(part.element, self.parameters):
            return False
        props = mi.Properties(part.props)
        for name, child in part.children.items():
            props[name] = child.made
        dropped = self._drop_what_is_refused_already(part, props)
        before = len(self.findings)
        if part.plugin == PAD:
            part.made = self._read_pad(part, props)
        else:
            part.made = self._retry(part, props, mi.PluginManager.instance().create_object)
        if part.made is not None and len(self.findings) == before:
            self._refuse_unread(part, props)
        return dropped

    def _drop_what_is_refused_already(self, part: ScenePart, props: Any) -> bool:
        """Remove parameters that `check_names` refuses, nested objects that a plugin does not know, and invalid
        transformations."""
        words = specifications().get(part.plugin)
        refused = []
        if words is not None:
            flawed = [child for child in part.element.children if error_in(child, words, self.parameters)]
            refused = [filled_in(child.attributes["name"], self.parameters) for child in flawed]
            for name, message in words.unknown(props).items():
                if name in part.children:
                    self.findings.append(part.children[name].finding("error", message))
                    del props[name]
        for name, message in far_transforms(part.props).items():
            said = f"{message}{guilty_parameters(self.parameters)}."
            self.findings.append(part.finding("error", said, name))
            refused.append(name)
        for name in set(refused) & set(props.keys()) - set(part.children):
            del props[name]
        return bool(refused)

    def _retry(self, part: ScenePart, props: Any, make: Callable[[Any], Any]) -> Any:
        """The result of ``make`` on the properties, without those that it refuses; None if it fails."""
        dropped: set[str] = set()
        while True:
            try:
                return make(props)
            except (InputError, RuntimeError, TypeError, ValueError) as error:
                message = _one_sentence(error, part.plugin)
            if dropped & set(re.findall(r"\w+", message)):  # it may be a consequence of parameters left out
                return None
            culprit = _culprit(message, props)
            self.findings.append(part.finding("error", message, culprit))
            if not culprit or culprit in part.children:
                return None
            del props[culprit]
            dropped.add(culprit)

    def _read_pad(self, part: ScenePart, props: Any) -> UndeformedPad | None:
        """Read a pad as its plugin does before solving for the deformation."""
        pad = self._retry(part, props, UndeformedPad)
        if pad is not None:
            self._check_cells(part, pad)
        return pad

    def _check_cells(self, part: ScenePart, pad: UndeformedPad) -> None:
        """Errors otherwise found only when solving: a mesh that is too large, or missing cells."""
        numbers, stated = pad.read_cells or (), pad.specification
        finish = stated.build_finish()
        if numbers and finish is not None:
            message = "read_cells is not allowed with a finish: it is laid on all cells."
            self.findings.append(part.finding("error", message, "read_cells"))
        wall = pad.bsdf()
        try:
            check_mirrors(pad.pad, mirrors(wall) if wall is not None else [], stated.subdivision)
            if isinstance(pad.pad, PadFile):
                pad.extent, pad.cell_boxes = extents_in_file(pad.pad, stated.mesh_size)
                cells = len(pad.cell_boxes)
            else:
                check_triangles(stated.subdivision, LEAST_FACES * (len(numbers) or pad.pad.rows * pad.pad.columns))
                check_room(pad.pad, stated.mesh_size or pad.pad.default_mesh_size)
                cells = pad.pad.rows * pad.pad.columns
            if finish is not None:
                refuse_finish(pad.pad, stated.mesh_size, finish, stated.subdivision)
        except InputError as error:
            self.findings.append(part.finding("error", str(error), _culprit(str(error), part.props)))
            return
        for number in numbers:
            if number > cells:
                message = f"read_cells = {number} is not allowed: the cells of the pad have numbers from 1 to {cells}."
                self.findings.append(part.finding("error", message, "read_cells"))

    def _refuse_unread(self, part: ScenePart, props: Any) -> None:
        for name in props.unqueried():
            if name in part.children:
                child = part.children[name]
                message = f"{part.plugin} has no use for the <{child.kind}> nested in it: take it out."
                self.findings.append(child.finding("error", message))
            else:
                message = f"{name} is no parameter of {part.plugin}: take it out."
                self.findings.append(part.finding("error", message, name))


def _one_sentence(error: Exception, plugin: str) -> str:
    """The error message of a plugin, without traceback or place in the source."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
    if lines[-1].startswith("KeyboardInterrupt"):
        raise KeyboardInterrupt
    if "Traceback" in lines[0]:
        lines = lines[-1:]
    text = re.sub(r"^(\[[^\]]*\] |[\w.]*Error: )+", "", " ".join(lines)).rstrip(".!")
    return f"{text}." if isinstance(error, InputError) or plugin in text else f"{plugin}: {text}."


def _culprit(message: str, props: Any) -> str:
    """The parameter with which a message begins, if it is among the properties."""
    names = set(props.keys())
    return next((word for word in re.findall(r"\w+", message)[:2] if word in names), "")
