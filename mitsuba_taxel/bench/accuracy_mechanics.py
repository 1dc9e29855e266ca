"""The mechanics: error of a reading against the time of the finite elements, by their size and by the load's steps."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.bench.work_precision import Curve, Point, Truth, now, relative_rms
from mitsuba_taxel.mechanics import load_path
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.path import load_segment
from mitsuba_taxel.mechanics.path import pad_path as path
from mitsuba_taxel.mechanics.path.loaded_pads import loaded_pad, mirror_images
from mitsuba_taxel.pads.pad import DEFAULT_MESH_SIZE, Pad
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.sensing.measurement import measure
from mitsuba_taxel.sensing.readings import ERROR_SHARE, Readings, standard_error
from mitsuba_taxel.sensing.scene import Scene
from mitsuba_taxel.sensing.scene_pads import loaded_pads
from mitsuba_taxel.sensing.targets import MOST_ELEMENTS

COARSEST = 2 * DEFAULT_MESH_SIZE
REFINEMENT = 2**0.5
"""Largest elements in mm, and how much smaller each next ones are."""
FEWEST_SIZES = 2
"""Solved for however long they take."""
TOLERANCES = (1e-2, 1e-3, 1e-4)
STRICT = 1e-6
"""Step tolerance of what counts as the truth for the others."""
POINTS = 1 << 12
"""Of light for each taxel and replicate, with the same random numbers everywhere."""
SEED = 1 << 20
ELEMENTS = "Elements are of second order (ten nodes) in all rows: there is no other order to compare."


@dataclass(frozen=True)
class Solved:
    """A scene whose pads were solved from nothing, and read.

    Attributes
    ----------
    readings : Readings
        With long light and the stated error of the mechanics.
    seconds : float
        Of the mechanics alone.
    elements : int
        Of the largest pad.
    """

    readings: Readings
    seconds: float
    elements: int


@dataclass(frozen=True)
class Limit:
    """Readings in the limit of small elements.

    Attributes
    ----------
    replicates : (R, T) ndarray
        Power in W.
    change : (T,) ndarray
        In W, that the extrapolation made; its error is taken to be as large.
    size : float
        Of the smallest elements solved on, in mm.
    """

    replicates: np.ndarray
    change: np.ndarray
    size: float

    @property
    def truth(self) -> Truth:
        """What other readings of the scene are judged by."""
        error = np.hypot(standard_error(self.replicates), self.change)
        return Truth(self.replicates.mean(axis=0), error, f"elements of {self.size:.2g} mm, extrapolated")


class PadRequest(NamedTuple):
    """A pad under a load, without the scene that it is part of."""

    pad: Pad | PadFile
    material: Material
    load: Load
    value: np.ndarray


def open_pads(live: Any, mesh_size: float | None) -> list[PadRequest]:
    """The loaded pads of a scene whose mesh it leaves open, so that they got that of a `Scene.mesh_size`."""
    return [
        PadRequest(pad.pad, pad.material, pad.load, np.array(pad.value))
        for pad in loaded_pads(live)
        if pad.mesh_size == mesh_size and pad.mesh_tolerance is None
    ]


class SizeRuns(NamedTuple):
    """Runs by the size of their elements in mm, the size of those that they are judged by, and why they end."""

    solved: dict[float, Solved]
    judge: float
    ended: str


def size_runs(scene: Scene, pads: Sequence[PadRequest], seconds: float, starting: Callable[[str], None]) -> SizeRuns:
    """The scene on smaller and smaller elements, until one solution would take longer, or elements be too many.

    They are judged by elements of half the size of the smallest, or the smallest that can be afforded. The next
    solution is taken to be longer as the last was, and at least as it has more elements.

    Raises
    ------
    ComputationError
        if the pads cannot be loaded on the coarsest mesh.
    """
    solved: dict[float, Solved] = {}
    size, judge = COARSEST, 0.5 * COARSEST
    starting("mechanics: warm-up")
    before = solve(scene, pads, size).seconds
    while True:
        starting(f"mechanics: elements of {size:.2g} mm")
        try:
            solved[size] = last = solve(scene, pads, size)
        except ComputationError as reason:
            if solved:
                return SizeRuns(solved, judge, f"no smaller elements: {reason}")
            raise
        if 2**3 * last.elements < MOST_ELEMENTS:
            judge = 0.5 * size
        size /= REFINEMENT
        if size < 1.1 * judge:
            return SizeRuns(solved, judge, f"elements of {judge:.2g} mm are the smallest that the memory is taken for")
        predicted = last.seconds * max(last.seconds / before, REFINEMENT**3)
        before = last.seconds
        if len(solved) >= FEWEST_SIZES and predicted > seconds:
            ended = f"elements of {size:.2g} mm left out: they would take about {predicted:.0f} s"
            return SizeRuns(solved, judge, ended)


def limits(scenes: Sequence[Scene], size: float) -> list[Limit]:
    """What each of some scenes reads in the limit of small elements: from those of ``size`` [mm] and of twice that.

    The error of a reading falls with the power `ORDER` of the elements' size, and so is known from two (L. F.
    Richardson, Phil. Trans. R. Soc. A 210, 1911).
    """
    with from_nothing():
        coarse, fine = (
            [measure(scene.with_mesh_size(h), points=POINTS, seed=SEED, mechanics_error=False) for scene in scenes]
            for h in (2 * size, size)
        )
    changes = [ERROR_SHARE * (there.replicates - here.replicates) for here, there in zip(coarse, fine, strict=True)]
    return [
        Limit(there.replicates + change, change.mean(axis=0), size) for there, change in zip(fine, changes, strict=True)
    ]


def tolerance_runs(
    scene: Scene, pads: Sequence[PadRequest], size: float, starting: Callable[[str], None]
) -> tuple[dict[float, Solved], Limit]:
    """The scene on one mesh with larger and smaller steps of the load, by their tolerance; and with very small ones."""
    solved = {}
    for tolerance in (*TOLERANCES, STRICT):
        starting(f"mechanics: step tolerance {tolerance:g}, elements of {size:.2g} mm")
        solved[tolerance] = solve(scene, pads, size, tolerance)
    strict = solved.pop(STRICT).readings
    return solved, Limit(strict.replicates, np.zeros(len(strict.taxel)), size)


def size_errors(solved: Mapping[float, Solved], limit: Limit, remark: str) -> Curve:
    """The curve of element sizes."""
    reference = limit.truth.name
    points = []
    for size, run in solved.items():
        stated = relative_rms(run.readings.mechanics_error, run.readings.power)
        points.append(_point(f"{size:.3g} mm", run, limit, stated, reference))
    return Curve("mechanics", "element size", points, remark=remark)


def tolerance_errors(solved: Mapping[float, Solved], strict: Limit) -> Curve:
    """The curve of step tolerances, on one mesh; readings state no error of their own for the steps."""
    reference = f"step tolerance {STRICT:g}, elements of {strict.size:.2g} mm"
    points = [_point(f"{tolerance:g}", run, strict, math.nan, reference) for tolerance, run in solved.items()]
    return Curve("mechanics", "step tolerance", points)


def _point(setting: str, run: Solved, limit: Limit, stated: float, reference: str) -> Point:
    """The error of a reading that shares its random numbers with the limit, so that the light drops out."""
    power = limit.truth.power
    difference = run.readings.replicates - limit.replicates
    return Point(
        setting=setting,
        seconds=run.seconds,
        error=relative_rms(difference.mean(axis=0), power),
        stated=stated,
        floor=relative_rms(np.hypot(standard_error(difference), limit.change), power),
        reference=reference,
        runs=1,
        readings=int((power > 0).sum()),
    )


def solve(
    scene: Scene, pads: Sequence[PadRequest], size: float, tolerance: float = load_segment.INTERPOLATION_TOLERANCE
) -> Solved:
    """Solve the pads of a scene from nothing and read it; the estimate of the error is part of the mechanics."""
    with from_nothing(tolerance):
        start = now()
        states = [
            state
            for pad in pads
            for state in load_path(pad.pad, pad.material, pad.value[None], load=pad.load, mesh_size=size)
        ]
        seconds = now() - start
        readings = measure(scene.with_mesh_size(size), points=POINTS, seed=SEED)
    return Solved(readings, seconds, max(len(state.mesh.tets) for state in states))


@contextmanager
def from_nothing(tolerance: float = load_segment.INTERPOLATION_TOLERANCE) -> Iterator[None]:
    """Let nothing that was solved before help, and load steps be chosen for another tolerance of the interpolation."""
    kept, before = os.environ.get("MITSUBA_TAXEL_CACHE"), load_segment.INTERPOLATION_TOLERANCE
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MITSUBA_TAXEL_CACHE"] = folder
        load_segment.INTERPOLATION_TOLERANCE = path.INTERPOLATION_TOLERANCE = tolerance
        _forget()
        try:
            yield
        finally:
            load_segment.INTERPOLATION_TOLERANCE = path.INTERPOLATION_TOLERANCE = before
            os.environ.pop("MITSUBA_TAXEL_CACHE")
            if kept is not None:
                os.environ["MITSUBA_TAXEL_CACHE"] = kept
            _forget()


def _forget() -> None:
    for kept in (path.pad_path, loaded_pad, mirror_images):
        kept.cache_clear()
