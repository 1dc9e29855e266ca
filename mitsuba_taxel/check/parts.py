"""The objects of a scene, created one by one to collect the errors of each; pads are read, but not deformed."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import resolved_path
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.check.document import KINDS, Element, filled_in
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.pads import extents_in_file, refuse_finish
from mitsuba_taxel.check.parameters import error_in, error_in_plugin
from mitsuba_taxel.kernels.pad_limits import LEAST_FACES, check_mirrors, check_triangles, mirrors
from mitsuba_taxel.pads import Block, PadFile, check_block_size
from mitsuba_taxel.pads.parametric.meshing import check_room
from mitsuba_taxel.sensing.scene.description import NESTED_SCENE
from mitsuba_taxel.sensing.scene.nested_parts import unused_parts
from mitsuba_taxel.sensing.scene.parsing import far_transforms, guilty_parameters
from mitsuba_taxel.specification import specifications
from mitsuba_taxel.specification.deformable_pad import DeformablePad

PAD = "deformable_pad"


class UndeformedPad:
    """A pad as a scene describes it, before its deformation is computed.

    Attributes
    ----------
    specification : DeformablePad
        Parameters of the pad.
    pad, material : AnyPad, Material
        See `load_path`.
    load : tuple[Load, tuple[float, ...]]
        The load and its value.
    read_cells : tuple[int, ...] or None
        Numbers of the cells that are read; None for all.
    to_world : (4, 4) ndarray
        Transformation from the pad's frame to world coordinates, in mm.
    objects : dict[str, object]
        Nested objects, by name.
    extent, cell_boxes : (2, 3) ndarray, (K, 2, 3) ndarray, or None
        For a pad from a file, lowest and highest coordinates in mm of the pad and of each of its K cells, in the pad's
        frame; None for other pads.
    """

    extent: np.ndarray | None = None
    cell_boxes: np.ndarray | None = None

    def __init__(self, props: Any) -> None:
        self.specification = specification = DeformablePad.read(props)
        self.pad = specification.build_pad(resolved_path)
        self.material = specification.build_material()
        self.load = specification.build_load(resolved_path)
        self.read_cells = specification.cell_numbers()
        self.to_world = (
            np.eye(4) if specification.to_world is None else np.array(specification.to_world.matrix, dtype=float)
        )
        self.objects = dict(props.objects())

    # Interface of shapes for `refuse_unmodelled`

    state = None

    def bsdf(self) -> Any:
        return next((obj for obj in self.objects.values() if isinstance(obj, mi.BSDF)), None)

    def interior_medium(self) -> Any:
        return self.objects.get("interior")

    def exterior_medium(self) -> Any:
        return self.objects.get("exterior")


@dataclass
class SceneObject:
    """One object of a scene: its XML element, its parameters and, if valid, the plugin object.

    Attributes
    ----------
    plugin, kind : str
        Name of the plugin, and tag of the XML element.
    element : Element
        XML element of the object.
    props : Any
        Parameters of the plugin, without nested objects.
    children : dict[str, SceneObject]
        Nested objects, by name.
    instance : Any
        The plugin object, or an `UndeformedPad` for a pad; None if it cannot be created.
    valid : bool
        Whether the instance was created exactly as described.
    """

    plugin: str
    kind: str
    element: Element
    props: Any
    children: dict[str, SceneObject]
    instance: Any = None
    valid: bool = False

    def finding(self, severity: str, message: str, name: str = "") -> Finding:
        """A finding at the line of the parameter ``name``, or at the line of the object.

        Parameters
        ----------
        severity : str
            One of `mitsuba_taxel.check.finding.SEVERITIES`.
        message : str
            Description of the error, and the remedy.
        name : str, optional
            Parameter of the object.

        Returns
        -------
        Finding
            Finding at the parameter if the object has one of that name.
        """
        for child in self.element.children:
            if name and child.attributes.get("name") == name:
                return child.finding(severity, message)
        return self.element.finding(severity, message)

    def nested(self, kind: str) -> list[SceneObject]:
        """The nested objects whose XML element has this name, such as ``bsdf``."""
        return [child for child in self.children.values() if child.kind == kind]


@dataclass
class SceneObjects:
    """All objects of a scene file.

    Attributes
    ----------
    file : str
        Name of the scene file.
    roots : list[SceneObject]
        Objects at the top level.
    all : list[SceneObject]
        All objects, including nested ones.
    findings : list[Finding]
        Errors of the plugins.
    """

    file: str
    roots: list[SceneObject]
    all: list[SceneObject]
    findings: list[Finding]

    @property
    def valid(self) -> bool:
        """Whether all objects were created as the scene describes them."""
        return all(obj.valid for obj in self.all)

    def of(self, *plugins: str) -> list[SceneObject]:
        """Valid objects of the scene that were created by one of the named plugins."""
        return [obj for obj in self.all if obj.valid and obj.plugin in plugins]

    def shapes(self) -> list[SceneObject]:
        """Valid shapes at the top level of the scene."""
        return [obj for obj in self.roots if obj.valid and obj.kind == "shape"]


def make_objects(state: Any, root: Element, parameters: Mapping[str, str]) -> SceneObjects:
    """Create the objects of a parsed scene, and collect the errors of their plugins.

    Parameters
    ----------
    state : mitsuba.parser.ParserState
        The scene as Mitsuba's parser returns it.
    root : Element
        Root of the scene's XML file, for the lines of findings.
    parameters : Mapping[str, str]
        Values of the ``$name`` references, by name.

    Returns
    -------
    SceneObjects
        The objects, and the findings on them.
    """
    maker = _Maker(state, root, parameters)
    scene = maker.object_of(0)
    everything = [obj for obj in maker.objects.values() if obj is not scene]
    return SceneObjects(root.file.name, list(scene.children.values()), everything, maker.findings)


class _Maker:
    """Creates each object once, nested objects first."""

    def __init__(self, state: Any, root: Element, parameters: Mapping[str, str]) -> None:
        self.state, self.root, self.parameters = state, root, parameters
        self.elements = {(element.file.resolve(), element.offset): element for element in root.walk()}
        self.findings: list[Finding] = []
        self.objects: dict[int, SceneObject] = {}

    def object_of(self, index: int) -> SceneObject:
        """The object that Mitsuba's parser describes in node number ``index``, created together with its nested
        objects.
        """
        if index in self.objects:
            return self.objects[index]
        node = self.state.nodes[index]
        props = node.props
        # Nested objects come first: an object is created from its children.
        nested = [name for name in props.keys() if props.type(name) == mi.Properties.Type.ResolvedReference]
        children = {name: self.object_of(props[name].index()) for name in nested}
        # The XML element lies in the node's file, one byte before the offset that Mitsuba records.
        element = self.root
        if node.file_index < len(self.state.files):
            file = Path(str(self.state.files[node.file_index])).resolve()
            element = self.elements.get((file, node.offset - 1), self.root)
        obj = self.objects[index] = SceneObject(
            props.plugin_name(), element.tag, element, mi.Properties(props), children
        )
        # Create the instance, and record whether errors were found on the way.
        for name, message in unused_parts(self.state.nodes, node).items():
            if children[name].plugin != PAD:  # `_create` reports nested pads
                self.findings.append(children[name].finding("error", message))
        if node.type == mi.ObjectType.Scene and index > 0:
            self.findings.append(obj.finding("error", NESTED_SCENE))
        elif node.type != mi.ObjectType.Scene:
            error_count = len(self.findings)
            incomplete = self._create(obj)
            created = obj.instance is not None and not incomplete and len(self.findings) == error_count
            obj.valid = created and all(child.valid for child in children.values())
        return obj

    def _create(self, obj: SceneObject) -> bool:
        """Create the instance of an object if possible. Returns whether parameters that the plugin refuses had to be
        removed.
        """
        # Objects with nested pads, with failed children or of unknown plugins cannot be created.
        for child in obj.children.values():
            if child.plugin == PAD:
                message = f"{PAD} is nested in a {obj.plugin}: move it to the top level of the scene."
                self.findings.append(child.finding("error", message))
                return False
        if any(child.instance is None for child in obj.children.values()):
            return False
        if obj.element.tag in KINDS and error_in_plugin(obj.element, self.parameters):
            return False
        # Create it without the parameters that have an error already, so that the remaining ones are checked as well.
        props = mi.Properties(obj.props)
        for name, child in obj.children.items():
            props[name] = child.instance
        incomplete = self._drop_refused(obj, props)
        error_count = len(self.findings)
        if obj.plugin == PAD:
            obj.instance = self._read_pad(obj, props)
        else:
            obj.instance = self._retry(obj, props, mi.PluginManager.instance().create_object)
        if obj.instance is not None and len(self.findings) == error_count:
            self._refuse_unread(obj, props)
        return incomplete

    def _drop_refused(self, obj: SceneObject, props: Any) -> bool:
        """Remove parameters that `check_names` refuses, unknown nested objects, and invalid transformations.

        Returns whether parameters were removed.
        """
        specification = specifications().get(obj.plugin)
        refused = []
        if specification is not None:
            refused_elements = [
                child for child in obj.element.children if error_in(child, specification, self.parameters)
            ]
            refused = [filled_in(child.attributes["name"], self.parameters) for child in refused_elements]
            for name, message in specification.unknown(props).items():
                if name in obj.children:
                    self.findings.append(obj.children[name].finding("error", message))
                    del props[name]
        for name, message in far_transforms(obj.props).items():
            explanation = f"{message}{guilty_parameters(self.parameters)}."
            self.findings.append(obj.finding("error", explanation, name))
            refused.append(name)
        for name in set(refused) & set(props.keys()) - set(obj.children):
            del props[name]
        return bool(refused)

    def _retry(self, obj: SceneObject, props: Any, make: Callable[[Any], Any]) -> Any:
        """Create an object by ``make`` from its properties. If it is refused, the refused properties are removed, and
        it is tried again; None if this fails, too.
        """
        dropped: set[str] = set()
        while True:
            try:
                return make(props)
            except (InputError, RuntimeError, TypeError, ValueError) as error:
                message = _one_sentence(error, obj.plugin)
            if dropped & set(re.findall(r"\w+", message)):  # it may be a consequence of parameters left out
                return None
            culprit = _culprit(message, props)
            self.findings.append(obj.finding("error", message, culprit))
            if not culprit or culprit in obj.children:
                return None
            del props[culprit]
            dropped.add(culprit)

    def _read_pad(self, obj: SceneObject, props: Any) -> UndeformedPad | None:
        """Read a pad as its plugin does before solving for the deformation."""
        pad = self._retry(obj, props, UndeformedPad)
        if pad is not None:
            self._check_cells(obj, pad)
        return pad

    def _check_cells(self, obj: SceneObject, pad: UndeformedPad) -> None:
        """Report errors that otherwise appear only in the solver: a mesh that is too large, or missing cells."""
        numbers, specification = pad.read_cells or (), pad.specification
        finish = specification.build_finish()
        if numbers and finish is not None:
            message = "read_cells is not allowed with a finish, which applies to all cells."
            self.findings.append(obj.finding("error", message, "read_cells"))
        # Sizes are judged by lower bounds, without a mesh; only a pad from a file is read for its cells.
        wall = pad.bsdf()
        try:
            check_mirrors(pad.pad, mirrors(wall) if wall is not None else [], specification.subdivision)
            if isinstance(pad.pad, PadFile):
                pad.extent, pad.cell_boxes = extents_in_file(pad.pad, specification.mesh_size)
                cells = len(pad.cell_boxes)
            elif isinstance(pad.pad, Block):
                check_block_size(pad.pad, specification.mesh_size or pad.pad.default_mesh_size)
                cells = 0
            else:
                check_triangles(
                    specification.subdivision, LEAST_FACES * (len(numbers) or pad.pad.rows * pad.pad.columns)
                )
                check_room(pad.pad, specification.mesh_size or pad.pad.default_mesh_size)
                cells = pad.pad.rows * pad.pad.columns
                if finish is not None:
                    refuse_finish(pad.pad, specification.mesh_size, finish, specification.subdivision)
        except InputError as error:
            self.findings.append(obj.finding("error", str(error), _culprit(str(error), obj.props)))
            return
        # Cells that are read must exist.
        for number in numbers:
            if number > cells:
                message = f"read_cells = {number} is not allowed: the cells of the pad have numbers from 1 to {cells}."
                self.findings.append(obj.finding("error", message, "read_cells"))

    def _refuse_unread(self, obj: SceneObject, props: Any) -> None:
        """Report nested objects and parameters that the plugin has not read."""
        for name in props.unqueried():
            if name in obj.children:
                child = obj.children[name]
                message = f"{obj.plugin} has no use for the <{child.kind}> nested in it: take it out."
                self.findings.append(child.finding("error", message))
            else:
                message = f"{name} is no parameter of {obj.plugin}: take it out."
                self.findings.append(obj.finding("error", message, name))


def _one_sentence(error: Exception, plugin: str) -> str:
    """The error message of a plugin, without traceback or position in the source code."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
    if lines[-1].startswith("KeyboardInterrupt"):
        raise KeyboardInterrupt
    if "Traceback" in lines[0]:
        lines = lines[-1:]
    text = re.sub(r"^(\[[^\]]*\] |[\w.]*Error: )+", "", " ".join(lines)).rstrip(".!")
    return f"{text}." if isinstance(error, InputError) or plugin in text else f"{plugin}: {text}."


def _culprit(message: str, props: Any) -> str:
    """Name of the property that an error message is about: the first or second word of the message. Empty if neither
    word is a property.
    """
    names = set(props.keys())
    return next((word for word in re.findall(r"\w+", message)[:2] if word in names), "")
