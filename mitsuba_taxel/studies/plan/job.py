"""Jobs of a study, one for each scene, and their outcomes: a result or a failure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from mitsuba_taxel.backend.own_plugins import loaded_plugins
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.units import HISTORY
from mitsuba_taxel.sensing import Readings
from mitsuba_taxel.sensing.scene.description import MESHED_AS
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT

MESHES, MAPS, IMAGES = "meshes", "maps", "images"
"""Folders of a study for the files of results."""


@dataclass(frozen=True)
class Job:
    """A job of a study: one scene whose readings are computed, and the settings for that.

    Attributes
    ----------
    number : int
        Number of the scene in its batch, from 0; the last dimension varies fastest.
    file : Path
        The scene.
    parameters : dict[str, str]
        Values of its parameters. With a value of `TO_CONTACT`, the derivatives are those of the load at first contact
        instead of those of the readings.
    points, seed : int
        See ``measure``; 0 if light should be computed without random numbers.
    mesh_size : float or None
        Size in mm of the finite elements of pads for which the description gives neither a mesh size nor a tolerance.
        See ``Scene``.
    mechanics_error : bool
        Whether to estimate the errors of readings due to finite elements and flat triangles. See ``measure``.
    meshes, maps : bool
        Whether to return the surfaces of the deformed pads, and the irradiance map.
    derivatives : tuple[str, ...]
        See ``measure``; their errors are computed together with that of the mechanics.
    where_smooth : bool
        Whether derivatives are computed only if the readings need no random numbers; otherwise they are omitted without
        a note.
    from_paths : bool
        Whether derivatives are differences of random paths where light without random numbers does not provide them.
    fitted : tuple[str, ...]
        Parameters among ``derivatives`` whose derivatives are slopes of a smooth curve through all readings of the
        study. The job leaves them NaN.
    bare : bool
        Whether the error of the pads' shape may remain unknown.
    continued : Readings or None
        Readings of the same scene with fewer points, which this job extends.
    base : dict[str, str] or None
        Parameters of a reference scene. Light is traced on the same random paths as in the reference scene, if the
        walls allow it: see `PairedReading`.
    sides : dict[str, int]
        For each parameter, the side on which the study has other values: 1 if all are larger, -1 if all are smaller, 0
        if they lie on both sides. At a kink, the derivative towards that side is computed.
    plugins : tuple[Path, ...]
        Files of the user's own plugins, loaded by the process that computes the job.
    """

    number: int
    file: Path
    parameters: dict[str, str]
    points: int
    seed: int
    mesh_size: float | None
    mechanics_error: bool
    meshes: bool
    maps: bool
    derivatives: tuple[str, ...] = ()
    where_smooth: bool = False
    from_paths: bool = False
    fitted: tuple[str, ...] = ()
    bare: bool = False
    continued: Readings | None = None
    base: dict[str, str] | None = None
    sides: dict[str, int] = field(default_factory=dict)
    plugins: tuple[Path, ...] = field(default_factory=loaded_plugins)


class JobResult(NamedTuple):
    """Result of a job: readings, computing time in s by stage, and the content of its files (PLY in mm, EXR) by name.
    """

    readings: Readings
    seconds: dict[str, float]
    files: dict[str, bytes]


@dataclass(frozen=True)
class ImageJob:
    """A job of a study of images: one scene whose camera's image is computed.

    Attributes
    ----------
    number, file, parameters, mesh_size, seed, plugins
        See `Job`.
    samples : int or None
        Number of samples per pixel and replicate; None for the default, or with a target error.
    target_error : float or None
        Target for the relative error of a pixel. See ``camera_image``.
    difference : bool
        Whether the difference to the image with unloaded pads is computed too.
    variant : str
        Variant of Mitsuba, which determines whether the image has colours.
    """

    number: int
    file: Path
    parameters: dict[str, str]
    mesh_size: float | None
    seed: int
    samples: int | None
    target_error: float | None
    difference: bool
    variant: str
    plugins: tuple[Path, ...] = field(default_factory=loaded_plugins)


class ImageResult(NamedTuple):
    """Result of a job of images: the content of the OpenEXR file, the facts in its header, and seconds by stage."""

    content: bytes
    about: dict[str, Any]
    seconds: dict[str, float]


@dataclass(frozen=True)
class Failure:
    """Reason why a job has no result, as it is stored and sent between processes.

    Attributes
    ----------
    message : str
        One line.
    bad_input : bool
        True if the input of the scene was refused; False if its computation failed.
    """

    message: str
    bad_input: bool = field(default=False)

    def error(self) -> InputError | ComputationError:
        """Convert the failure to an exception with its message."""
        return (InputError if self.bad_input else ComputationError)(self.message)


def describe(values: Mapping[str, str], roles: Mapping[str, Sequence[Any]] = MappingProxyType({})) -> str:
    """Text by which messages identify a scene: the values of its parameters, such as ``fz=-4, fx=1``.

    Load histories and the mesh's reference scene are omitted, and `TO_CONTACT` too unless it is the only value.

    Parameters
    ----------
    values : Mapping[str, str]
        Values by parameter.
    roles : Mapping[str, Sequence[Any]]
        Role of each parameter (see `roles_of_parameters`), and its sign. By default, the role is the parameter's name.
    """
    past = {name for name, (role, *_) in roles.items() if role == HISTORY} or {HISTORY}
    shown = {name: value for name, value in values.items() if name not in past | {MESHED_AS}}
    if shown.keys() - {TO_CONTACT}:
        shown.pop(TO_CONTACT, None)
    return ", ".join(" ".join(f"{name}={value}".split()) for name, value in shown.items())
