"""A batch: one scene, its varied parameters and its targets; and the TOML file that describes it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number, names_of, plain_number, require, table_of, word_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.toml import read_toml
from mitsuba_taxel.base.units import LOADS
from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.electronics.circuit import circuit_of
from mitsuba_taxel.sensing import Scene, find_scene
from mitsuba_taxel.sensing.measurement import check_request
from mitsuba_taxel.sensing.scene.finding import is_file, shipped_scenes
from mitsuba_taxel.sensing.scene.parameter_roles import forces_of_parameters, load_constants, roles_of_parameters
from mitsuba_taxel.studies.plan.histories import histories
from mitsuba_taxel.studies.plan.steps import read_steps
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT
from mitsuba_taxel.studies.plan.vary import STEP, Axis, make_axes

TABLES = ("define", "vary", "together")
SCENE_KEYS = ("scene", *TABLES, "steps")
RUN_KEYS = (
    "target_error", "points", "time_budget", "mesh_size", "seed", "maps", "derivatives", "target_slope",
    "circuit", "meshes", "difference",
)  # fmt: skip
CHOSEN = ("target_error", "points", "time_budget", "mesh_size", "target_slope")
"""Keys of a run that a written study file holds only if they have a value."""
KEPT_MESHES = ("all", "last", "none")
"""Choices of the deformed pads to store: of all scenes, of the last scene of each curve, or none."""
WRITTEN_KEYS = ("provenance",)
"""Additional keys of a study file in a folder of results, which can be run again unchanged."""


@dataclass(frozen=True)
class Batch:
    """Definition of a batch: one scene, computed at every combination of the values of its varied parameters.

    Attributes
    ----------
    name : str
        Name of the scene, and of its subfolder of results, in a study of several scenes; else blank.
    file : Path
        The scene.
    defines : dict[str, str]
        Values of the parameters that are not varied, by name.
    axes : tuple[Axis, ...]
        Dimensions, at least one.
    target_error, time_budget, mesh_size : float or None
        See ``sweep``; common to all scenes.
    points : int or None
        See ``sweep``. 0 requests light without random numbers; users cannot set it.
    seed : int
        Whole number from 0 to 2**32 - 1. See ``sweep``.
    maps : bool
        Whether irradiance maps are stored as well.
    derivatives : tuple[str, ...]
        Parameters with respect to which readings are differentiated.
    target_slope : float or None
        Target for the relative error of the slopes of readings with respect to the varied forces.
    circuit : Circuit or None
        Read-out circuit whose voltages are reported with the powers.
    from_paths : bool
        Whether derivatives are computed by random paths where light without random numbers does not provide them.
    bare : bool
        Whether only readings are computed: no meshes, no slopes, and no errors of mechanics and geometry; no tables or
        plots are written.
    meshes : str
        Which meshes are stored: one of :data:`KEPT_MESHES`.
    difference : bool
        Whether differences of a camera's images to that of the unloaded pad are stored as well.
    """

    name: str
    file: Path
    defines: dict[str, str]
    axes: tuple[Axis, ...]
    target_error: float | None
    points: int | None
    time_budget: float | None
    mesh_size: float | None
    seed: int
    maps: bool = False
    derivatives: tuple[str, ...] = ()
    target_slope: float | None = None
    circuit: Circuit | None = None
    from_paths: bool = False
    bare: bool = False
    meshes: str = "all"
    difference: bool = False

    def scene(self, values: Mapping[str, str]) -> Scene:
        """The scene of the batch with given values of the varied parameters."""
        assigned = {**self.defines, **values}
        return Scene(self.file, {name: word for name, word in assigned.items() if name != TO_CONTACT}, self.mesh_size)

    def parameters(self, values: Mapping[str, str]) -> dict[str, str]:
        """All parameters of :meth:`scene` by name, and `TO_CONTACT` if it has a value."""
        assigned = {**self.defines, **values}
        return {**self.scene(values).parameters, **{name: assigned[name] for name in (TO_CONTACT,) if name in assigned}}

    @property
    def varied_forces(self) -> tuple[str, ...]:
        """Names of the forces that have several values, varied alone or together with other parameters."""
        return _forces(self.axes, self.forces)

    @cached_property
    def forces(self) -> dict[str, tuple[str, int]]:
        """Names of the scene's parameters that are forces, each with the component of the force that it sets and its
        sign; see `forces_of_parameters`."""
        return forces_of_parameters(self.file)

    @cached_property
    def roles(self) -> dict[str, tuple[str, int]]:
        """Role and sign of each parameter of the scene, by its name; see `roles_of_parameters`."""
        return roles_of_parameters(self.file)

    @property
    def loads(self) -> list[str]:
        """Names of the scene's parameters that are components of a load."""
        return loads_among(self.roles)

    def as_toml(self) -> dict[str, Any]:
        """The batch as the content of a study file, with all values written out."""
        vary = {axis.dim: axis.values[axis.dim] for axis in self.axes if axis.dim != STEP}
        together = {
            name: words for axis in self.axes if axis.dim not in axis.values for name, words in axis.values.items()
        }
        chosen = {name: getattr(self, name) for name in CHOSEN}  # points = 0: a study finds out that it needs none
        circuit = self.circuit.as_table() if self.circuit else {}
        tables = {"circuit": circuit, "define": self.defines, "vary": vary, "together": together}
        return {
            "scene": self.file.name if self.file.parent == shipped_scenes() else str(self.file),
            "seed": self.seed,
            **{name: value for name, value in chosen.items() if value},
            **({"maps": True} if self.maps else {}),
            **({"meshes": self.meshes} if self.meshes != "all" else {}),
            **({"difference": True} if self.difference else {}),
            **({"derivatives": list(self.derivatives)} if self.derivatives else {}),
            **{name: table for name, table in tables.items() if table},
        }


def make_batch(
    source: str | Path,
    vary: Mapping[str, str | Iterable[object]],
    defines: Mapping[str, object] | None = None,
    *,
    together: Mapping[str, str | Iterable[object]] | None = None,
    target_error: float | None = None,
    points: int | None = None,
    time_budget: float | None = None,
    mesh_size: float | None = None,
    seed: int = 0,
    maps: bool = False,
    difference: bool = False,
    derivatives: Sequence[str] = (),
    target_slope: float | None = None,
    circuit: Circuit | None = None,
    meshes: str = "all",
    name: str = "",
    folder: Path = Path(),
) -> Batch:
    """Create a `Batch` from the arguments of :func:`sweep`, with all checks that need no loaded scene.

    Parameters
    ----------
    source : str or Path
        Path or name of the scene.
    vary : Mapping[str, str or Iterable[object]]
        Values of each varied parameter, as for :func:`sweep`.
    defines : Mapping[str, object], optional
        Values of the parameters that are not varied, by name.
    together : Mapping[str, str or Iterable[object]], optional
        Values of parameters that vary together, as for :func:`sweep`.
    target_error : float, optional
        Target for the relative total error (mechanics and light) of the worst taxel. See :func:`sweep`.
    points : int, optional
        Number of light paths for each taxel and randomisation, instead of a target error. See :func:`sweep`.
    time_budget : float, optional
        Largest duration of the study in s. See :func:`sweep`.
    mesh_size : float, optional
        Size of the finite elements in mm, for pads whose scene does not set it. See :func:`sweep`.
    seed : int
        Whole number from 0 to 2**32 - 1. See :func:`sweep`.
    maps : bool
        Whether to write irradiance maps to ``output`` as well, as OpenEXR. See :func:`sweep`.
    difference : bool
        Whether to store the difference of each image to that of the unloaded pad as well. See :func:`sweep`.
    derivatives : sequence of str
        Parameters with respect to which readings are differentiated, as for :func:`measure`. See :func:`sweep`.
    target_slope : float, optional
        Target error of the slopes against the varied forces, relative to the slope of the steepest taxel. See
        :func:`sweep`.
    circuit : Circuit, optional
        Read-out circuit, whose voltages and counts are returned with the powers. See :func:`sweep`.
    meshes : str
        Which deformed pads to write to ``output``: ``all``, the ``last`` of each curve, or ``none``. See :func:`sweep`.
    name : str
        Name of the scene, in a study of several.
    folder : Path
        Folder to which names of files are relative.

    Returns
    -------
    Batch
        The batch.

    Raises
    ------
    InputError
        if a parameter or a value is refused.
    """
    if not isinstance(source, (str, Path)):
        kind = type(source).__name__
        raise InputError(f"a scene of type {kind} is not allowed in a study: path or name of an XML file is needed.")
    # The scene: a file relative to the study's folder precedes a shipped scene of the same name.
    relative = folder / source
    file = find_scene(relative if is_file(relative) else source).resolve()

    # The dimensions.
    fixed = {name: word_of(value) for name, value in table_of("defines", defines, "values").items()}
    forces = forces_of_parameters(file)
    roles = roles_of_parameters(file)
    axes = make_axes(vary, together, folder, forces, loads_among(roles))
    for parameter in (name for axis in axes for name in axis.values):
        if parameter in fixed:
            raise InputError(f"{parameter} is both varied and given a value: take one of them out.")

    # Settings of the run, each checked alone, then together with the derivatives.
    if points is not None and time_budget is not None:
        raise InputError("points and time_budget exclude each other in a study: give one of them.")
    if mesh_size is not None and not (is_number(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size!r} is not allowed: a finite size in mm above 0 is needed.")
    for flag, value in {"maps": maps, "difference": difference}.items():
        if not isinstance(value, (bool, np.bool_)):
            raise InputError(f"{flag} = {value!r} is not allowed: true or false is needed.")
    differentiated = names_of("derivatives", derivatives)
    if target_slope is not None:
        differentiated = tuple(dict.fromkeys((*differentiated, *_forces_for(target_slope, axes, forces))))
    # Steps of an open range are chosen from derivatives by its parameter.
    open_ranges = [axis.dim for axis in axes if axis.is_open]
    check_request(target_error, points, seed, time_budget, [*differentiated, *open_ranges])
    if circuit is not None:
        require("circuit", circuit, Circuit, "a Circuit")
    if not isinstance(meshes, str) or meshes not in KEPT_MESHES:
        raise InputError(f"meshes = {meshes!r} is not allowed: one of {', '.join(KEPT_MESHES)} is needed.")
    batch = Batch(
        name=name,
        file=file,
        defines=fixed,
        axes=axes,
        target_error=plain_number(target_error),
        points=plain_number(points),
        time_budget=plain_number(time_budget),
        mesh_size=plain_number(mesh_size),
        seed=plain_number(seed),
        maps=bool(maps),
        derivatives=differentiated,
        target_slope=plain_number(target_slope),
        circuit=circuit,
        meshes=meshes,
        difference=bool(difference),
    )

    # The scene with the first values: it refuses unknown parameters, and lists those without effect.
    scene = batch.scene({name: words[0] for axis in axes for name, words in axis.values.items()})
    for parameter in (name for axis in axes for name in axis.values if name in scene.unused):
        raise InputError(f"{parameter} cannot be varied: nothing in {scene.name} uses its <default>.")

    # Steps with times get the load history of each step as one more column.
    varied_alone = [axis.dim for axis in axes if axis.dim != STEP]
    constants = load_constants(file)
    with_histories = []
    for axis in axes:
        if axis.dim == STEP:
            history = histories(axis.values, scene.parameters, varied_alone, roles, constants) or {}
            axis = axis._replace(values={**axis.values, **history})
        with_histories.append(axis)
    return replace(batch, axes=tuple(with_histories))


def loads_among(roles: Mapping[str, tuple[str, int]]) -> list[str]:
    """Select the parameters that set a component of the load: of a force, a displacement or a pressure.

    Parameters
    ----------
    roles : Mapping[str, tuple[str, int]]
        Result of `roles_of_parameters`.

    Returns
    -------
    list[str]
        Names in the order of the roles.
    """
    return [name for name, (role, _) in roles.items() if any(role in names for names in LOADS)]


def _forces(axes: Iterable[Axis], forces: Collection[str]) -> tuple[str, ...]:
    return tuple(name for axis in axes if axis.size > 1 for name in axis.values if name in forces)


def check_target_slope(target_slope: object) -> None:
    """Check a target error of slopes: None, or a number between 0 and 1.

    Raises
    ------
    InputError
        if it is anything else.
    """
    if target_slope is not None and not (is_number(target_slope) and 0 < target_slope < 1):  # type: ignore[operator]
        raise InputError(f"target_slope = {target_slope!r} is not allowed: a number between 0 and 1 is needed.")


def _forces_for(target_slope: object, axes: Iterable[Axis], names: Collection[str]) -> tuple[str, ...]:
    """Names of the varied forces to whose slopes the target applies; raises `InputError` if there are none."""
    check_target_slope(target_slope)
    forces = _forces(axes, names)
    if not forces:
        shown = ", ".join(names)
        raise InputError(f"target_slope = {target_slope!r} is not allowed: one of {shown} must be varied.")
    return forces


def read_study_of(table: str, file: Path) -> tuple[dict[str, Any], Any]:
    """Read a study file of one scene that contains an additional table, such as ``[fit]``.

    Parameters
    ----------
    table : str
        Name of the additional table.
    file : Path
        Study file (TOML).

    Returns
    -------
    study : dict[str, Any]
        Content of the file as :func:`read_study` returns it, without the table.
    own : Any
        Content of the table, unchecked; None if the file has none.

    Raises
    ------
    InputError
        if the file cannot be read, has unknown keys, or holds several scenes.
    """
    content = read_study(file, besides=(table,))
    if len(content["scenes"]) > 1 or "name" in content["scenes"][0]:
        raise InputError(f"study {file.name} is not allowed: one scene alone, without [[scenes]], is needed.")
    own = content.pop(table, None)
    return content, own


def read_study(file: str | Path, besides: tuple[str, ...] = ()) -> dict[str, Any]:
    """Read a study file, and check its keys.

    Parameters
    ----------
    file : str or Path
        Study file (TOML), of one scene or with ``[[scenes]]``.
    besides : tuple[str, ...]
        Keys that are allowed in addition to those of a study.

    Returns
    -------
    dict[str, Any]
        Keys and values of the file. Its scenes are a list of tables under ``scenes``, also if there is only one, which
        has a ``name`` only in a file with ``[[scenes]]``.

    Raises
    ------
    InputError
        if the file cannot be read, or has unknown keys.
    """
    # The file, with the scenes of both forms of a study in a list.
    content = read_toml(f"study {str(file)!r}", Path(file))
    several = "scenes" in content
    allowed = (*RUN_KEYS, *WRITTEN_KEYS, *besides, *(("scenes",) if several else SCENE_KEYS))
    _check_names(content, allowed, f"study {Path(file).name}")
    scenes = content.pop("scenes", None)
    if not several:
        scenes = [{name: content.pop(name) for name in SCENE_KEYS if name in content}]
    if not (isinstance(scenes, list) and scenes and all(isinstance(scene, dict) for scene in scenes)):
        raise InputError(f"study {Path(file).name}: scenes must be tables, each under the heading [[scenes]].")
    # Each scene: known keys, and tables of values.
    for number, scene in enumerate(scenes, start=1):
        where = f"scene {number} of {Path(file).name}" if several else f"study {Path(file).name}"
        _check_names(scene, (*SCENE_KEYS, *(("name",) if several else ())), where)
        if several:
            scene.setdefault("name", f"scene_{number}")
        for name in TABLES:
            if not isinstance(scene.get(name, {}), dict):
                raise InputError(
                    f"{where}: {name} = {scene[name]!r} is not allowed: a table of values by parameter is needed."
                )
    # Names are subfolders of the results.
    names = [scene.get("name", "") for scene in scenes]
    if several and not all(isinstance(name, str) and name.isidentifier() for name in names):
        raise InputError(f"study {Path(file).name}: names = {names} are not allowed: letters, digits and _ are needed.")
    if len(set(names)) < len(names):
        raise InputError(f"study {Path(file).name}: names = {names} are not allowed: distinct names are needed.")
    return {**content, "scenes": scenes}


def batch_from(study: Mapping[str, Any], number: int, folder: Path) -> Batch:
    """Create the `Batch` of one scene from the content of a study file.

    Parameters
    ----------
    study : Mapping[str, Any]
        Content of a study file from :func:`read_study`.
    number : int
        Index of the scene in its ``scenes``.
    folder : Path
        Folder to which paths in the study are relative.

    Returns
    -------
    Batch
        The batch.

    Raises
    ------
    InputError
        if a parameter or a value is refused.
    """
    scene = study["scenes"][number]
    if "scene" not in scene:
        raise InputError("scene is missing: a file, or the name of a shipped scene, is needed.")
    tables = {name: scene.get(name, {}) for name in TABLES}
    together = dict(tables["together"])
    if "steps" in scene:
        together.update(columns_of(folder / str(scene["steps"]), parameters=parameters_in(str(scene["scene"]), folder)))
    run = {name: study[name] for name in RUN_KEYS if name in study}
    if "circuit" in run:
        run["circuit"] = circuit_of(run["circuit"])
    return make_batch(
        str(scene["scene"]),
        {name: _listed(values) for name, values in tables["vary"].items()},
        {name: _word(value) for name, value in tables["define"].items()},
        together={name: _listed(values) for name, values in together.items()},
        name=scene.get("name", ""),
        folder=folder,
        **run,
    )


def parameters_in(source: str, folder: Path = Path()) -> Mapping[str, str]:
    """Default values of the parameters of a scene, by name; empty if the scene cannot be read.

    Parameters
    ----------
    source : str
        File relative to ``folder``, or the name of a shipped scene.
    folder : Path
        Folder of the study file.

    Returns
    -------
    Mapping[str, str]
        Defaults by name.
    """
    try:
        relative = folder / source
        return Scene(relative if is_file(relative) else source).defaults
    except InputError:  # reported where the scene is loaded
        return {}


def columns_of(file: Path, what: str = "steps", parameters: Collection[str] = ()) -> dict[str, list[str]]:
    """Read the columns of a CSV file of load steps, as lists of values by parameter.

    Parameters
    ----------
    file : Path
        The CSV file.
    what : str
        Description of the file, for messages.
    parameters : collection of str
        Parameters of the scene.

    Returns
    -------
    dict[str, list[str]]
        Values by parameter.
    """
    rows = read_steps(file, what, parameters)
    return {name: [row[name] for row in rows] for name in rows[0]}


def _listed(values: object) -> str | list[object]:
    """Convert values to the form that :func:`make_axes` takes: a single number becomes a list."""
    if isinstance(values, list):
        return [_word(value) for value in values]
    return values if isinstance(values, str) else [_word(values)]


def _word(value: object) -> object:
    return str(value).lower() if isinstance(value, bool) else value


def _check_names(table: Mapping[str, Any], allowed: Iterable[str], where: str) -> None:
    for name in table:
        if name not in allowed:
            raise InputError(f"{where}: {name} is not known: allowed are {', '.join(sorted(allowed))}.")
