"""Work-precision diagrams of a scene: error against computing time of each method."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.accuracy.chain import chain_curves, near_load, reading_curve, slope_limit
from mitsuba_taxel.evidence.accuracy.mechanics import (
    PadRequest,
    limits,
    open_pads,
    size_errors,
    size_runs,
    tolerance_errors,
    tolerance_runs,
)
from mitsuba_taxel.evidence.accuracy.optics import REFERENCE_TIME, optics_curves
from mitsuba_taxel.evidence.accuracy.plot import plot_accuracy
from mitsuba_taxel.evidence.accuracy.tables import write_csv
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve
from mitsuba_taxel.pads.parametric.pad import DEFAULT_MESH_SIZE
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.studies.plan.files import make_folder


def accuracy(
    scene: Scene, folder: Path, seconds: float, starting: Callable[[str], None] = lambda step: None
) -> list[ErrorCurve]:
    """Measure error against computing time for all methods, and write ``accuracy.csv``, ``accuracy.png`` and
    ``accuracy.svg`` to a folder.

    Parameters
    ----------
    scene : Scene
        The scene.
    folder : Path
        Output folder, which is created if it does not exist.
    seconds : float
        CPU time for each light-transport method, and for the longest solution of the mechanics, in s. References, and
        each reading to a target error (wall time), may take four times as long, and the reference mesh of the mechanics
        sixteen times.
    starting : Callable[[str], None]
        Called with the name of each step.

    Returns
    -------
    list[ErrorCurve]
        A curve for each method; the remark of a curve without points gives the reason.

    Raises
    ------
    InputError
        if the time is not allowed, the scene cannot be built or read, or the folder cannot be written to.
    ComputationError
        if a load path fails, or if fewer than two independent methods can compute the light.
    """
    if not 0 < seconds < math.inf:
        raise InputError(f"seconds = {seconds} is not allowed: a finite number above 0 is needed.")
    make_folder(folder)
    built = prepare(scene).scene
    taxels_of(built)
    pads, loaded = open_pads(built, scene.mesh_size), bool(loaded_pads(built))
    del built
    # The light first. Its curves are written before the mechanics, which takes longer.
    curves, light = optics_curves(scene, seconds, starting)
    _write(curves, scene, folder)
    if pads:
        curves += _with_pads(scene, pads, seconds, starting)
    elif loaded:
        reason = "the scene fixes the mesh size of its loaded pads: there is nothing to compare it with"
        curves += [ErrorCurve(stage, "", [], remark=reason) for stage in ("mechanics", "chain")]
    else:
        curves.append(ErrorCurve("mechanics", "", [], remark="no pad of the scene is loaded"))
        curves.append(reading_curve(scene, light, REFERENCE_TIME * seconds, starting))
    _write(curves, scene, folder)
    return curves


def _write(curves: Sequence[ErrorCurve], scene: Scene, folder: Path) -> None:
    write_csv(curves, folder / "accuracy.csv")
    plot_accuracy(curves, title(scene), folder)


def title(scene: Scene) -> str:
    """Title of a work-precision diagram: the name of the scene, and its parameters that differ from their defaults."""
    changed = [f"{name} = {value}" for name, value in scene.parameters.items() if value != scene.defaults.get(name)]
    return ", ".join([scene.name, *changed])


def _with_pads(
    scene: Scene, pads: Sequence[PadRequest], seconds: float, starting: Callable[[str], None]
) -> list[ErrorCurve]:
    """Curves of error against time for a scene with loaded pads: of the mechanics alone, and of the whole chain from
    force to reading."""
    # Solutions by mesh size, and readings in the limit of small elements, at the load and at a smaller load.
    nearby = near_load(scene)
    try:
        solved, reference_size, ended = size_runs(scene, pads, seconds, starting)
        starting(f"mechanics: reference on elements of {reference_size:.2g} mm")
        mesh_limits = limits([scene, nearby.scene] if nearby else [scene], reference_size)
    except ComputationError as reason:
        return [ErrorCurve(stage, "", [], remark=str(reason)) for stage in ("mechanics", "chain")]
    # Errors by mesh size, and by step tolerance on elements of about the default size.
    truth = mesh_limits[0].truth
    sizes = size_errors(solved, mesh_limits[0], ended)
    default_size = min(solved, key=lambda h: abs(h - DEFAULT_MESH_SIZE))
    steps = tolerance_errors(*tolerance_runs(scene, pads, default_size, starting))
    # The chain, with slopes by the force if the force loads the pad.
    slopes = slope_limit(mesh_limits[0], mesh_limits[1], nearby.step).truth if nearby else None
    if slopes is not None and not slopes.power.any():
        nearby = slopes = None
    return [sizes, steps, *chain_curves(scene, truth, nearby, slopes, REFERENCE_TIME * seconds, starting)]
