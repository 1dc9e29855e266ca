"""Error of a reading due to the mechanics against the time of the finite elements, for several mesh sizes and load-step
tolerances."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import clear_caches
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, TruthEstimate, WorkPoint, now, relative_rms
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.mechanics import State, load_path
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE
from mitsuba_taxel.mechanics.continuation.pad_path import shared
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad, mirror_images
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.parametric.pad import DEFAULT_MESH_SIZE
from mitsuba_taxel.sensing.measurement import measure
from mitsuba_taxel.sensing.reading.readings import ERROR_SHARE, Readings
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads
from mitsuba_taxel.sensing.targets import MOST_ELEMENTS

COARSEST = 2 * DEFAULT_MESH_SIZE
REFINEMENT = 2**0.5
"""Largest elements in mm, and the ratio of successive sizes."""
FEWEST_SIZES = 2
"""Number of mesh sizes that are solved regardless of the time limit."""
TOLERANCES = (1e-2, 1e-3, 1e-4)
STRICT = 1e-6
"""Step tolerance of the reference."""
POINTS = 1 << 12
"""Number of light paths for each taxel and replicate; all readings share their random numbers."""
SEED = 1 << 20
ELEMENTS = "Elements are of second order (ten nodes) in all rows: there is no other order to compare."


@dataclass(frozen=True)
class UncachedReadings:
    """Readings of a scene whose pads were solved without caches, with their cost.

    Attributes
    ----------
    readings : Readings
        Readings with many light paths, and with the stated error of the mechanics.
    seconds : float
        CPU time of the mechanics alone, in s.
    elements : int
        Number of elements of the largest pad.
    """

    readings: Readings
    seconds: float
    elements: int


@dataclass(frozen=True)
class FineMeshLimit:
    """Readings in the limit of small elements.

    Attributes
    ----------
    replicates : (R, T) ndarray
        Power in W of T taxels in R replicates, extrapolated to elements of size 0.
    change : (T,) ndarray
        Change of the power by the extrapolation, in W; it is stated as the error of the power.
    size : float
        Size of the smallest elements, in mm.
    """

    replicates: np.ndarray
    change: np.ndarray
    size: float

    @property
    def truth(self) -> TruthEstimate:
        """The extrapolated readings as reference values for other readings of the scene."""
        error = np.hypot(standard_error(self.replicates), self.change)
        return TruthEstimate(self.replicates.mean(axis=0), error, f"elements of {self.size:.2g} mm, extrapolated")


class PadRequest(NamedTuple):
    """A pad with its material and load, to be solved without the rest of its scene."""

    pad: AnyPad
    material: Material
    load: Load
    value: np.ndarray

    def state(self, mesh_size: float, step_tolerance: float) -> State:
        """Solve the pad on elements of ``mesh_size`` in mm, with load steps of a relative ``step_tolerance``."""
        path = partial(load_path, mesh_size=mesh_size, step_tolerance=step_tolerance)
        return path(self.pad, self.material, self.value[None], load=self.load)[0]


def open_pads(live: Any, mesh_size: float | None) -> list[PadRequest]:
    """The loaded pads of a scene for which the description fixes no mesh size, so that `Scene.mesh_size` applies."""
    return [PadRequest(pad.pad, pad.material, pad.load, np.array(pad.value)) for pad in _open(live, mesh_size)]


def _open(live: Any, mesh_size: float | None) -> list[PadShape]:
    return [pad for pad in loaded_pads(live) if pad.mesh_size == mesh_size and pad.mesh_tolerance is None]


class SizeRuns(NamedTuple):
    """Readings of a scene by mesh size in mm, the mesh size of their reference in mm, and the reason why smaller
    elements were not solved.
    """

    solved: dict[float, UncachedReadings]
    judge: float
    ended: str


def size_runs(scene: Scene, pads: Sequence[PadRequest], seconds: float, starting: Callable[[str], None]) -> SizeRuns:
    """Solve a scene on successively smaller elements, until the next solution would exceed the time or the memory.

    The reference has elements of half the smallest size, or the smallest elements that fit into memory. The time of the
    next solution is predicted from the growth of time between the last two; it grows at least as the number of elements
    does.

    Parameters
    ----------
    scene : Scene
        The scene.
    pads : sequence of PadRequest
        Loaded pads of the scene.
    seconds : float
        Largest CPU time of a solution.
    starting : Callable[[str], None]
        Called with the name of each step.

    Raises
    ------
    ComputationError
        if the pads cannot be solved on the coarsest mesh.
    """
    solved: dict[float, UncachedReadings] = {}
    size, reference_size = COARSEST, 0.5 * COARSEST
    starting("mechanics: warm-up")
    previous_seconds = solve(scene, pads, size).seconds
    while True:
        starting(f"mechanics: elements of {size:.2g} mm")
        try:
            solved[size] = last = solve(scene, pads, size)
        except ComputationError as error:
            if solved:
                return SizeRuns(solved, reference_size, f"no smaller elements: {error}")
            raise
        if 2**3 * last.elements < MOST_ELEMENTS or _elements(pads, 0.5 * size) < MOST_ELEMENTS:
            reference_size = 0.5 * size
        size /= REFINEMENT
        if size < 1.1 * reference_size:
            return SizeRuns(
                solved, reference_size, f"elements of {reference_size:.2g} mm are the smallest for the memory"
            )
        predicted = last.seconds * max(last.seconds / previous_seconds, REFINEMENT**3)
        previous_seconds = last.seconds
        if len(solved) >= FEWEST_SIZES and predicted > seconds:
            remark = f"elements of {size:.2g} mm left out: they would take about {predicted:.0f} s"
            return SizeRuns(solved, reference_size, remark)


def _elements(pads: Sequence[PadRequest], size: float) -> int:
    """Number of elements of the largest pad. The pads are meshed for this, because small elements near walls make the
    number hard to predict."""
    return max(len(pad_mesh(pad.pad, size).tets) for pad in pads)


def limits(scenes: Sequence[Scene], size: float) -> list[FineMeshLimit]:
    """Extrapolate the readings of scenes to elements of size 0.

    The error of a reading is proportional to the mesh size to the power `ORDER`. The limit follows from two mesh sizes
    (L. F. Richardson, Phil. Trans. R. Soc. A 210, 1911).

    Parameters
    ----------
    scenes : sequence of Scene
        The scenes.
    size : float
        The smaller of two mesh sizes in mm; the other is twice as large.
    """
    with from_nothing():
        coarse, fine = (
            [measure(scene.with_mesh_size(h), points=POINTS, seed=SEED, mechanics_error=False) for scene in scenes]
            for h in (2 * size, size)
        )
    changes = [
        ERROR_SHARE * (fine_reading.replicates - coarse_reading.replicates)
        for coarse_reading, fine_reading in zip(coarse, fine, strict=True)
    ]
    return [
        FineMeshLimit(fine_reading.replicates + change, change.mean(axis=0), size)
        for fine_reading, change in zip(fine, changes, strict=True)
    ]


def tolerance_runs(
    scene: Scene, pads: Sequence[PadRequest], size: float, starting: Callable[[str], None]
) -> tuple[dict[float, UncachedReadings], FineMeshLimit]:
    """Solve a scene on one mesh with several tolerances of the error of load steps, and with a very strict tolerance as
    the reference.

    Parameters
    ----------
    scene : Scene
        The scene.
    pads : sequence of PadRequest
        Loaded pads of the scene.
    size : float
        Mesh size in mm.
    starting : Callable[[str], None]
        Called with the name of each step.

    Returns
    -------
    solved : dict[float, UncachedReadings]
        Runs by tolerance.
    strict : FineMeshLimit
        Readings with the strict tolerance.
    """
    solved = {}
    for tolerance in (*TOLERANCES, STRICT):
        starting(f"mechanics: step tolerance {tolerance:g}, elements of {size:.2g} mm")
        solved[tolerance] = solve(scene, pads, size, tolerance)
    strict = solved.pop(STRICT).readings
    return solved, FineMeshLimit(strict.replicates, np.zeros(len(strict.taxel)), size)


def size_errors(solved: Mapping[float, UncachedReadings], limit: FineMeshLimit, remark: str) -> ErrorCurve:
    """Compute the errors of readings for each mesh size.

    Parameters
    ----------
    solved : Mapping[float, UncachedReadings]
        Runs by mesh size in mm.
    limit : FineMeshLimit
        Reference values.
    remark : str
        Remark of the curve.
    """
    reference = limit.truth.name
    points = []
    for size, run in solved.items():
        stated_error = relative_rms(run.readings.mechanics_error, run.readings.power)
        points.append(_point(f"{size:.3g} mm", run, limit, stated_error, reference))
    return ErrorCurve("mechanics", "element size", points, remark=remark)


def tolerance_errors(solved: Mapping[float, UncachedReadings], strict: FineMeshLimit) -> ErrorCurve:
    """Compute the errors of readings due to the load steps, for each step tolerance on one mesh. The stated errors of
    readings do not include this error.

    Parameters
    ----------
    solved : Mapping[float, UncachedReadings]
        Runs by tolerance.
    strict : FineMeshLimit
        Reference values, from the same mesh.
    """
    reference = f"step tolerance {STRICT:g}, elements of {strict.size:.2g} mm"
    points = [_point(f"{tolerance:g}", run, strict, math.nan, reference) for tolerance, run in solved.items()]
    return ErrorCurve("mechanics", "step tolerance", points)


def _point(setting: str, run: UncachedReadings, limit: FineMeshLimit, stated_error: float, reference: str) -> WorkPoint:
    """Point of the diagram for a reading: its time, and its true and stated error. Its random numbers are those of the
    limit, so that the noise of the light cancels in the error."""
    power = limit.truth.power
    difference = run.readings.replicates - limit.replicates
    return WorkPoint(
        setting=setting,
        seconds=run.seconds,
        error=relative_rms(difference.mean(axis=0), power),
        stated=stated_error,
        floor=relative_rms(np.hypot(standard_error(difference), limit.change), power),
        reference=reference,
        runs=1,
        readings=int((power > 0).sum()),
    )


def solve(
    scene: Scene, pads: Sequence[PadRequest], size: float, step_tolerance: float = INTERPOLATION_TOLERANCE
) -> UncachedReadings:
    """Solve the pads of a scene without caches, and compute the readings. The time of the mechanics includes its error
    estimate.

    Parameters
    ----------
    scene : Scene
        The scene.
    pads : sequence of PadRequest
        Loaded pads of the scene.
    size : float
        Mesh size in mm.
    step_tolerance : float
        Relative tolerance of the load steps.
    """
    with from_nothing():
        start = now()
        states = [pad.state(size, step_tolerance) for pad in pads]
        seconds = now() - start
        ready = prepare(scene.with_mesh_size(size))
        for pad, state in zip(_open(ready.scene, size), states, strict=True):
            pad.take(state)
        ready.scene.parameters_changed([])
        readings = measure(ready, points=POINTS, seed=SEED)
    return UncachedReadings(readings, seconds, max(len(state.mesh.tets) for state in states))


@contextmanager
def from_nothing() -> Iterator[None]:
    """Context manager: within the block, caches of solutions are empty at first, on disk and in memory."""
    kept = os.environ.get("MITSUBA_TAXEL_CACHE")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MITSUBA_TAXEL_CACHE"] = folder
        _forget()
        try:
            yield
        finally:
            os.environ.pop("MITSUBA_TAXEL_CACHE")
            if kept is not None:
                os.environ["MITSUBA_TAXEL_CACHE"] = kept
            _forget()


def _forget() -> None:
    clear_caches(shared, loaded_pad, mirror_images)
