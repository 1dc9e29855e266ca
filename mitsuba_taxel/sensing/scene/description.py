"""Description of a scene: an XML file with parameters, or a dictionary as for Mitsuba."""

from __future__ import annotations

import copy
import gc
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakSet

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.base.arguments import (
    as_numbers,
    is_number,
    path_of,
    plain_number,
    refusal,
    require,
    table_of,
    text_of,
    word_of,
)
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError, UnusedDefault
from mitsuba_taxel.base.files.atomic import WriteError, write_text
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.parts.part import SUFFIX
from mitsuba_taxel.sensing.scene.finding import find_scene
from mitsuba_taxel.sensing.scene.left_out import NONE, parse_scene, used_by
from mitsuba_taxel.sensing.scene.parsed_pads import (
    announce_packages,
    build_pads_last,
    move_meshes,
    pads_of,
    take_load,
)
from mitsuba_taxel.sensing.scene.parsing import (
    as_own_error,
    far_transforms,
    guilty_parameters,
    parser_config,
    with_own_parameters,
)
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file

if TYPE_CHECKING:
    import mitsuba as mi

MOST_PARAMETERS = 1000
"""Largest number of parameters of a scene; the limit of Mitsuba's parser is a little higher."""
MOST_NAMED = 10
"""Largest number of unused defaults that are named individually."""
END_OF_PATH = "the load path ends at"
"""Phrase in the error for a pad that has no equilibrium under its load."""
MESHED_AS = "meshed_as"
"""Parameter of all scenes from files. Its value has the form 'name=value', separated by commas, and defines a second
scene with these parameter values. The meshes of the pads of that scene are moved to the dimensions of the pads of this
scene."""

_EMITTERS: WeakSet[mi.Emitter] = WeakSet()
"""Emitters of the loaded scenes that have not been freed."""

NESTED_SCENE = "a scene is nested in another object, where it has no effect: take it out."


class Scene(Displayed):
    """A description of a Mitsuba scene, with the values of its parameters.

    Parameters
    ----------
    source : str or Path or dict[str, Any]
        Path of an XML file, name of a shipped one, or a dictionary as for ``mi.load_dict`` (with ``"type": "scene"``).
    parameters : Mapping[str, object], optional
        Values for the ``<default>`` elements of the file, by name. The value ``none`` leaves out the elements that use
        the parameter. The value of ``meshed_as``, such as ``cell_size=2.5, wall=1``, names a second set of parameter
        values: pads are meshed with these, and the meshes are then moved to the actual dimensions.
    mesh_size : float, optional
        Size in mm of the finite elements of pads for which the description gives neither a mesh size nor a tolerance;
        None for the default.

    Raises
    ------
    InputError
        if the file does not exist, is not valid XML, or lacks a given parameter.

    Warns
    -----
    UnusedDefault
        if the file has ``<default>`` elements that no other element uses; ``unused`` lists their names.
    """

    def __init__(
        self,
        source: str | Path | dict[str, Any],
        parameters: Mapping[str, object] | None = None,
        mesh_size: float | None = None,
    ) -> None:
        if isinstance(source, dict):
            _refuse_none(source)
        self.source = source if isinstance(source, dict) else find_scene(source)
        if not (mesh_size is None or (is_number(mesh_size) and mesh_size > 0)):
            raise refusal("mesh_size", mesh_size, "a finite size in mm above 0 is needed")
        self.mesh_size = plain_number(mesh_size)
        self.defaults: dict[str, str] = {}
        values = {name: word_of(value) for name, value in table_of("parameters", parameters, "values").items()}
        self.unused: tuple[str, ...] = ()
        allowed: set[str] = set()
        if isinstance(self.source, Path):
            self.defaults, used = _declared_parameters(self.source)
            allowed = used | set(self.defaults)
            self.unused = tuple(name for name in self.defaults if name not in used)
        for name, value in values.items():
            if name not in allowed | ({MESHED_AS} if self.defaults else set()):
                names = ", ".join(sorted(allowed)) or "none"
                raise InputError(f"{name} is not a parameter of {self.name}: allowed are {names}.")
            text_of(name, value)
            if re.fullmatch(r"\s*[+-]?\d*,\d+\s*", value) and as_numbers([self.defaults.get(name, "")]):
                point = value.strip().replace(",", ".")
                raise refusal(name, value, f"a decimal point is needed, as in {point}")
        self.parameters = {**self.defaults, **values}
        if len(self.parameters) > MOST_PARAMETERS:
            count = len(self.parameters)
            raise InputError(
                f"{self.name} with {count} parameters is not allowed: at most {MOST_PARAMETERS} are possible."
            )
        if self.unused:
            names = ", ".join(self.unused[:MOST_NAMED])
            more = f" and {len(self.unused) - MOST_NAMED} more" if len(self.unused) > MOST_NAMED else ""
            unused = f"{self.name}: nothing uses the <default> {names}{more}"
            warnings.warn(f"{unused}: take it out, or write its name with $ where it belongs.", UnusedDefault, 2)
        self.leaves_mesh_open = False  # known once the scene has been loaded

    @classmethod
    def from_file(cls, source: str | Path, /, **parameters: object) -> Scene:
        """Make a scene from an XML file.

        Parameters
        ----------
        source : str or Path
            Path of the file or, for a shipped scene, its name (``pad.xml``).
        **parameters : object
            Values for the ``<default>`` elements of the file, by name.

        Returns
        -------
        Scene
            The scene; its file is read again whenever it is loaded.

        Raises
        ------
        InputError
            if there is no such file, or the scene lacks one of the parameters.
        """
        require("source", source, (str, Path), "the path or name of an XML scene")
        return cls(source, parameters)

    def __deepcopy__(self, memo: dict[int, Any]) -> Scene:
        """An independent copy of the scene. Mitsuba's objects in a dictionary are shared with the copy, because they
        never change."""
        copied = copy.copy(self)
        copied.source = _copied(self.source) if isinstance(self.source, dict) else self.source
        copied.defaults, copied.parameters = dict(self.defaults), dict(self.parameters)
        return copied

    @property
    def name(self) -> str:
        """Name of the file, or ``scene`` for a scene made in Python."""
        return self.source.name if isinstance(self.source, Path) else "scene"

    def with_mesh_size(self, mesh_size: float | None) -> Scene:
        """The same scene with another size of finite elements, unless its description fixes the size.

        Parameters
        ----------
        mesh_size : float or None
            Target length of the edges of elements, mm; None for the default.

        Returns
        -------
        Scene
            A new scene.
        """
        parameters = {} if isinstance(self.source, dict) else self.parameters
        return Scene(self.source, parameters, mesh_size)

    @in_turn
    def load(self) -> mi.Scene:
        """Build the ``mi.Scene`` in the current variant of Mitsuba (the default variant if none is set), and deform its
        pads.

        Returns
        -------
        mi.Scene
            The loaded scene.

        Raises
        ------
        InputError
            if Mitsuba or a plugin refuses the description; the message is one line.
        ComputationError
            if a pad has no equilibrium under its load, or touches a package without `self_contact`.
        """
        import mitsuba as mi

        from mitsuba_taxel.sensing.scene.clearance import heed_packages

        with stages.stage("load"), self.files_beside_it():
            config = parser_config(activate_variant())
            _free_unused_scenes()
            try:
                state = self.parsed(config)
                self._refuse_far_transforms(state)
                mi.parser.transform_all(config, state)
                build_pads_last(state)
                announce_packages(state)
                live = mi.parser.instantiate(config, state)
            except InputError as error:  # raised before Mitsuba builds any object
                raise InputError(with_own_parameters(str(error), self), error.part) from error
            except RuntimeError as error:
                if END_OF_PATH in str(error):
                    self._refuse_contact(config)
                raise as_own_error(error, self) from error
            _EMITTERS.update(emitter for emitter in live.emitters() if hasattr(emitter, "__weakref__"))
            heed_packages(live)
            return live

    def load_at_rest(self) -> mi.Scene:
        """Build the ``mi.Scene`` like `load`, but without the loads of its pads.

        Returns
        -------
        mi.Scene
            The scene with unloaded pads, which rest on no package.

        Raises
        ------
        InputError
            if Mitsuba or a plugin refuses the description; the message is one line.
        """
        import mitsuba as mi

        with stages.stage("load"), self.files_beside_it():
            config = parser_config(activate_variant())
            try:
                state = self.parsed(config)
                mi.parser.transform_all(config, state)
                for pad in pads_of(state):
                    take_load(pad)
                return mi.parser.instantiate(config, state)
            except RuntimeError as error:
                raise as_own_error(error, self) from error

    def _refuse_contact(self, config: mi.parser.ParserConfig) -> None:
        """Raise if a pad touches a package before the end of its load path. The mechanics of a pad alone does not
        detect this contact."""
        import mitsuba as mi

        from mitsuba_taxel.sensing.scene.clearance import heed_packages
        from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

        state = self.parsed(config)
        mi.parser.transform_all(config, state)
        loads = [take_load(pad) for pad in pads_of(state)]
        try:
            at_rest = mi.parser.instantiate(config, state)
        except RuntimeError:  # something else is wrong as well
            return
        for pad, (value, history) in zip(deformed_pads(at_rest), loads, strict=True):  # in the order of the scene
            pad.value, pad.history = value, history
        heed_packages(at_rest)

    def write_xml(self, path: str | Path) -> None:
        """Write the scene as an XML file with parameters, whose readings are bit-identical to those of this scene; see
        :meth:`as_xml`.

        Parameters
        ----------
        path : str or Path
            The file, which is replaced if it exists.

        Raises
        ------
        InputError
            if the scene is refused, or the file cannot be written.
        """
        path = path_of("path", path)
        text = self.as_xml(path.parent)
        try:
            write_text(path, text)
        except WriteError as error:
            raise InputError(str(error)) from error

    @in_turn
    def as_xml(self, folder: Path) -> str:
        """The scene as the text of an XML file, with its values as ``<default>`` elements.

        A scene from a file keeps the parameters of the file. In a scene made in Python, the numbers and words of its
        plugins become parameters; see `scene_text` for their names.

        Parameters
        ----------
        folder : Path
            Folder of the file that will hold the text; paths in the text are relative to it.

        Returns
        -------
        str
            The document.

        Raises
        ------
        InputError
            if the scene is refused.
        """
        from mitsuba_taxel.sensing.scene.written_scene import scene_text

        config = parser_config(activate_variant())
        file = None if isinstance(self.source, dict) else self.source
        try:
            with self.files_beside_it():
                return scene_text(
                    self.parsed(config), config, folder.absolute(), file, self._own_parameters, MOST_PARAMETERS
                )
        except RuntimeError as error:
            raise as_own_error(error, self) from error

    @contextmanager
    def files_beside_it(self) -> Iterator[None]:
        """Context manager: resolve the files named in a scene relative to its folder. Libraries of plugins are loaded
        from trusted folders only.

        Yields
        ------
        None
            Nothing; after the ``with`` block, files are resolved as before.
        """
        import mitsuba as mi

        from mitsuba_taxel.backend.libraries import put_own_libraries_first

        before = mi.file_resolver()
        resolver = mi.FileResolver(before)  # a copy: parsing <path> adds to it
        if isinstance(self.source, Path):
            resolver.prepend(str(self.source.resolve().parent))
        put_own_libraries_first(resolver)
        mi.set_file_resolver(resolver)
        try:
            yield
        finally:
            mi.set_file_resolver(before)

    def _refuse_far_transforms(self, state: mi.parser.ParserState) -> None:
        for props in (node.props for node in state.nodes):
            for message in far_transforms(props).values():
                raise InputError(f"{message}{guilty_parameters(self.parameters)}.")

    def parsed(self, config: mi.parser.ParserConfig) -> mi.parser.ParserState:
        """Parse the description without building any object.

        Parameters
        ----------
        config : mi.parser.ParserConfig
            Settings of the parser for the variant that will build the scene.

        Returns
        -------
        mi.parser.ParserState
            All nodes of the description; the first is the scene.

        Raises
        ------
        InputError
            if the description is not allowed, for example because of nested scenes, unused objects or missing files.
        """
        import mitsuba as mi

        from mitsuba_taxel.backend.libraries import check_plugin_types
        from mitsuba_taxel.backend.plugin_objects import find_file
        from mitsuba_taxel.sensing.scene.named_files import check_named_files
        from mitsuba_taxel.sensing.scene.nested_parts import unused_parts

        if isinstance(self.source, dict):
            check_plugin_types(_types(self.source))
            state = mi.parser.parse_dict(config, self.source)
            check_named_files(node.props for node in state.nodes)
        else:
            state = parse_scene(config, self.source, self._own_parameters)
        if any(node.type == mi.ObjectType.Scene for node in state.nodes[1:]):
            raise InputError(f"{self.name}: {NESTED_SCENE}")
        for message in (said for node in state.nodes for said in unused_parts(state.nodes, node).values()):
            raise InputError(message)
        with self.files_beside_it():
            for node in state.nodes:
                if node.props.plugin_name() == "photo_reflector":
                    find_file(node.props, "part", SUFFIX)
        pads = pads_of(state)
        self._move_meshes(pads, config)
        without_mesh_size = [pad for pad in pads if not ("mesh_size" in pad or "mesh_tolerance" in pad)]
        self.leaves_mesh_open = bool(without_mesh_size)
        for pad in without_mesh_size if self.mesh_size is not None else []:
            pad["mesh_size"] = self.mesh_size
        return state

    @in_turn
    def has_camera(self) -> bool:
        """Whether the scene has one of Mitsuba's own sensors, such as a camera; no object is built.

        Returns
        -------
        bool
            True with such a sensor. A scene that cannot be parsed gives False; its error is raised when it is loaded.
        """
        import mitsuba as mi

        try:
            nodes = self.parsed(parser_config(activate_variant())).nodes
        except (InputError, RuntimeError):
            return False
        sensors = [node.props.plugin_name() for node in nodes if node.type == mi.ObjectType.Sensor]
        return any(name != "phototransistor" for name in sensors)

    @property
    def _own_parameters(self) -> dict[str, str]:
        """Parameters of the file and their default values, by name."""
        return {name: value for name, value in self.parameters.items() if name != MESHED_AS or name in self.defaults}

    def _move_meshes(self, pads: list[mi.Properties], config: mi.parser.ParserConfig) -> None:
        """If the scene has a value of `MESHED_AS`, mesh its pads with the parameter values that it names, and move
        these meshes to the actual dimensions."""
        own = self._own_parameters
        origin = NONE if MESHED_AS in own else self.parameters.get(MESHED_AS, NONE)
        if origin == NONE:
            return
        pairs = [[word.strip() for word in pair.split("=")] for pair in origin.split(",")]
        if not all(len(pair) == 2 for pair in pairs):
            raise InputError(f"{MESHED_AS} = {origin!r} is not allowed: 'name=value', separated by commas, is needed.")
        try:
            move_meshes(pads, pads_of(Scene(self.source, own | dict(pairs)).parsed(config)))
        except (InputError, RuntimeError) as error:
            refused = error if isinstance(error, InputError) else as_own_error(error, self)
            raise InputError(f"{MESHED_AS} = {origin!r} is not allowed: {refused}") from error


def _refuse_none(description: dict[str, Any], within: str = "scene") -> None:
    """Raise `InputError` if a scene's dictionary contains None, for which Mitsuba's parser would abort the process."""
    for name, value in description.items():
        if value is None:
            raise InputError(f"{within}: {name} = None is not allowed: leave it out.")
        if isinstance(value, dict):
            _refuse_none(value, name)


def _types(description: Mapping[str, Any]) -> Iterator[str]:
    """Names of all plugins in a dictionary that describes a scene."""
    for name, value in description.items():
        if name == "type" and isinstance(value, str):
            yield value
        elif isinstance(value, Mapping):
            yield from _types(value)


def _copied(value: Any) -> Any:
    """Deep copy of dictionaries and lists; other objects are shared."""
    if isinstance(value, dict):
        return {name: _copied(item) for name, item in value.items()}
    return [_copied(item) for item in value] if isinstance(value, list) else value


def write_xml(scene: Scene, path: str | Path) -> None:
    """Write a scene as an XML file with parameters; see :meth:`Scene.write_xml`.

    Parameters
    ----------
    scene : Scene
        Scene read from a file or made in Python.
    path : str or Path
        The file, which is replaced if it exists.

    Raises
    ------
    InputError
        as :meth:`Scene.write_xml`.
    """
    require("scene", scene, Scene, "a Scene")
    scene.write_xml(path)


def _declared_parameters(path: Path) -> tuple[dict[str, str], set[str]]:
    """The ``<default>`` values of an XML scene by name, and the names that its elements use as ``$name``."""
    defaults: dict[str, str] = {}
    used: set[str] = set()
    for file, root in read_scene_file(path):
        own: dict[str, str] = {}
        for element in root.iter("default"):
            name = element.get("name", "")
            if name in own:
                raise InputError(f"{file.name}: the <default> {name} is given twice: take one of them out.")
            own[name] = element.get("value", "")
        defaults, used = {**own, **defaults}, used.union(*(used_by(element.attrib) for element in root.iter()))
    return defaults, used


def _free_unused_scenes() -> None:
    """Free loaded scenes that are kept alive by reference cycles only, for example by the traceback of an error.

    Dr.Jit's kernels contain the plugins of all scenes that are alive: with an unused scene, they would be compiled
    again.
    """
    if _EMITTERS:
        gc.collect()
