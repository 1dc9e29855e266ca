"""Jobs of a study: one scene each, and what comes of it."""

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

MESHES, MAPS = "meshes", "maps"
"""Folders of a study for the files of results."""


@dataclass(frozen=True)
class Job:
    """One scene to read.

    Attributes
    ----------
    number : int
        Number of the scene in its batch, from 0; the last dimension varies fastest.
    file : Path
        The scene.
    parameters : dict[str, str]
        Values of its parameters, and of `TO_CONTACT`, with which derivatives are those of the first contact instead.
    points, seed : int
        As for ``measure``; 0 if light should be computed without random numbers.
    mesh_size : float or None
        As for ``Scene``.
    mechanics_error : bool
        As for ``measure``.
    meshes, maps : bool
        Whether to return the surfaces of its pads, and its irradiance map.
    derivatives : tuple[str, ...]
        As for ``measure``; their errors are computed together with that of the mechanics.
    where_smooth : bool
        Whether they are computed only where readings need no random numbers, and left out without a remark elsewhere.
    bare : bool
        Whether the error of the pads' shape may remain unknown.
    continued : Readings or None
        Readings of the same scene with fewer points, which this job extends.
    sides : dict[str, int]
        On which side all curves of the study go on from here, by parameter: 1 at larger, -1 at smaller values.
    plugins : tuple[Path, ...]
        Files of the user's own plugins, which the process that computes it runs first.
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
    bare: bool = False
    continued: Readings | None = None
    sides: dict[str, int] = field(default_factory=dict)
    plugins: tuple[Path, ...] = field(default_factory=loaded_plugins)


class JobResult(NamedTuple):
    """Result of a job: readings, seconds by stage, and the content of its files (PLY in mm, EXR) by name."""

    readings: Readings
    seconds: dict[str, float]
    files: dict[str, bytes]


@dataclass(frozen=True)
class Failure:
    """Failure of a job.

    Attributes
    ----------
    message : str
        One line.
    bad_input : bool
        Whether the scene was refused, rather than its computation failed.
    """

    message: str
    bad_input: bool = field(default=False)

    def error(self) -> InputError | ComputationError:
        """The failure as an exception."""
        return (InputError if self.bad_input else ComputationError)(self.message)


def describe(values: Mapping[str, str], roles: Mapping[str, Sequence[Any]] = MappingProxyType({})) -> str:
    """Values of parameters, in words, without the load history, what meshes are moved from, and the way to contact if
    any else is told. Parameters without one of the ``roles`` are what they are called."""
    past = {name for name, (role, *_) in roles.items() if role == HISTORY} or {HISTORY}
    shown = {name: value for name, value in values.items() if name not in past | {MESHED_AS}}
    if shown.keys() - {TO_CONTACT}:
        shown.pop(TO_CONTACT, None)
    return ", ".join(" ".join(f"{name}={value}".split()) for name, value in shown.items())
