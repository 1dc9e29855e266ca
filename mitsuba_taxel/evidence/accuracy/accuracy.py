"""Work-precision diagrams of a scene: error against time of each method."""

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
    """Measure error against time, and write ``accuracy.csv``, ``accuracy.png`` and ``accuracy.svg`` to a folder.

    Parameters
    ----------
    seconds : float
        Of all processors together, for each light-transport method, and for the longest solution of the mechanics;
        references, and each reading to a target error (wall time), may take four times as long, and the reference mesh
        of the mechanics sixteen times.
    starting : Callable[[str], None]
        Called with the name of each step.

    Raises
    ------
    InputError
        if the time is not allowed, the scene cannot be built or read, or the folder cannot be written to.
    ComputationError
        if a load path fails, or no two independent methods can compute the light.
    """
    if not 0 < seconds < math.inf:
        raise InputError(f"seconds = {seconds} is not allowed: a finite number above 0 is needed.")
    make_folder(folder)
    live = prepare(scene).scene
    taxels_of(live)
    pads, loaded = open_pads(live, scene.mesh_size), bool(loaded_pads(live))
    del live
    curves, light = optics_curves(scene, seconds, starting)
    _write(curves, scene, folder)
    if pads:
        curves += _with_pads(scene, pads, seconds, starting)
    elif loaded:
        reason = "the scene fixes the mesh size of its loaded pads: there is nothing to compare it with"
        curves += [ErrorCurve(part, "", [], remark=reason) for part in ("mechanics", "chain")]
    else:
        curves.append(ErrorCurve("mechanics", "", [], remark="no pad of the scene is loaded"))
        curves.append(reading_curve(scene, light, REFERENCE_TIME * seconds, starting))
    _write(curves, scene, folder)
    return curves


def _write(curves: Sequence[ErrorCurve], scene: Scene, folder: Path) -> None:
    write_csv(curves, folder / "accuracy.csv")
    plot_accuracy(curves, title(scene), folder)


def title(scene: Scene) -> str:
    """The scene's name, and its parameters that differ from the default."""
    changed = [f"{name} = {value}" for name, value in scene.parameters.items() if value != scene.defaults.get(name)]
    return ", ".join([scene.name, *changed])


def _with_pads(
    scene: Scene, pads: Sequence[PadRequest], seconds: float, starting: Callable[[str], None]
) -> list[ErrorCurve]:
    """Curves of the mechanics and of the whole chain."""
    near = near_load(scene)
    try:
        solved, judge, ended = size_runs(scene, pads, seconds, starting)
        starting(f"mechanics: reference on elements of {judge:.2g} mm")
        found = limits([scene, near.scene] if near else [scene], judge)
    except ComputationError as reason:
        return [ErrorCurve(part, "", [], remark=str(reason)) for part in ("mechanics", "chain")]
    truth = found[0].truth
    sizes = size_errors(solved, found[0], ended)
    middle = min(solved, key=lambda h: abs(h - DEFAULT_MESH_SIZE))
    steps = tolerance_errors(*tolerance_runs(scene, pads, middle, starting))
    slopes = slope_limit(found[0], found[1], near.step).truth if near else None
    if slopes is not None and not slopes.power.any():  # the force does not load the pad
        near = slopes = None
    return [sizes, steps, *chain_curves(scene, truth, near, slopes, REFERENCE_TIME * seconds, starting)]
