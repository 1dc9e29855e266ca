"""What a target error takes: how fine a mesh, and how many points.

The target is met by both together, as the root of the sum of their squares. Elements, and with them the triangles of
curved walls, are made smaller until the shape takes its share of it; the light gets what is left. Pilot runs, whose
random numbers do not enter the result, say how much either needs.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base import stages
from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.sensing.facets import curved_pads, past_chords
from mitsuba_taxel.sensing.mechanics_error import combined, mechanics_deviations
from mitsuba_taxel.sensing.readings import Readings, geometry_share, mechanics_share, standard_error
from mitsuba_taxel.sensing.runs import FIRST_POINTS, MOST_POINTS, Clock, Prepared, Run, derived_seed, described, prepare
from mitsuba_taxel.sensing.scene import Scene
from mitsuba_taxel.sensing.scene_pads import loaded_pads

MECHANICS_SHARE = 0.85
"""Of a target error. More points cost little: a scrambled net's error falls nearly as their number grows."""
LIGHT_SHARE = 0.5
"""Of a target error that the mechanics does not reach."""
DEVIATION_POINTS, MOST_DEVIATION_POINTS = 256, 1 << 14
"""For each taxel and replicate, of the two traces that tell what the mechanics' error does: domes take many."""
DEVIATION_SHARE = 4
"""Of the points of a reading, what these traces have at most: a change has a fifth of the noise of a reading."""
GEOMETRY_POINTS = 64
"""As the least of those, for the facets' error: the first of a pilot run's, which goes on from them."""
GEOMETRY_SHARE = 8
"""Of the points of a reading, what each of the two traces for the facets' error has at most."""
CLEAR, NEGLIGIBLE = 1 / 3, 0.2
"""What the error of mechanics or facets may itself be uncertain by: part of it, or part of a target error."""
COST_ORDER = 4.0
"""With which the time of the mechanics grows as elements get smaller."""
RUNG, MOST_RUNGS = 0.9, 7
"""Sizes of elements are tried down a ladder, so that studies share what was solved; so many rungs at once. A rung is a
seventh of an error, so that what is chosen is not much finer than what was asked for."""
MOST_MESHES = 4
MOST_ELEMENTS = 250_000
"""Of a pad; a quarter of the paper's with so many takes about four gigabytes."""

_SCATTER, _SAFETY = 0.13, 1.3
"""A standard error from 32 replicates is itself known to 13 %, and is to stay below the target in nearly all scenes."""


class Settings(NamedTuple):
    """What a reading takes: points for each taxel and replicate; mesh size of pads in mm, None for the scene's own."""

    points: int
    mesh_size: float | None


class Mechanics(NamedTuple):
    """What the mechanics' error does to readings.

    Attributes
    ----------
    deviation : (T,) ndarray or None
        In W, as in `Readings`; None where no pad is loaded.
    share : float
        Relative error that it stands for; not a number where it is unknown.
    """

    deviation: np.ndarray | None
    share: float


class Geometry(NamedTuple):
    """What the flat triangles of curved walls do to readings.

    Attributes
    ----------
    facets : (T,) ndarray or None
        In W, as in `Readings`; None where no wall is curved.
    share : float
        Relative error that they stand for.
    pilot : Run or None
        The first of the runs of :func:`points_for`, where it has been done already.
    """

    facets: np.ndarray | None
    share: float
    pilot: Run | None


FLAT = Geometry(None, 0.0, None)


class Aimed(NamedTuple):
    """A scene that was made ready for a target error, what its shape is off by, and the points left to trace."""

    ready: Prepared
    mechanics: Mechanics
    geometry: Geometry
    settings: Settings


def geometry_of(ready: Prepared, seed: int, most: int = FIRST_POINTS, tolerance: float = 0.0) -> Geometry:
    """What facets do to the readings of a scene, by two short traces, of as many points as :func:`mechanics_of`."""
    if not curved_pads(ready.scene):
        return FLAT
    pilot, chords = (Run(ready, derived_seed(seed, 1)) for _ in range(2))
    points = GEOMETRY_POINTS
    while True:
        pilot.go_on(points)
        with past_chords(ready.scene):
            chords.go_on(points)
        changes, power = chords.powers - pilot.powers, pilot.powers.mean(axis=0)
        facets = changes.mean(axis=0)
        share, noise = (geometry_share(change, power) for change in (facets, standard_error(changes)))
        more = _more_points(share, noise, tolerance)
        if more == 1 or points >= most:
            return Geometry(facets, share, pilot)
        points = min(points * more, most)


def mechanics_of(ready: Prepared, seed: int, most: int = DEVIATION_POINTS, tolerance: float = 0.0) -> Mechanics:
    """What the mechanics' error does to the readings of a scene, by three short traces.

    These are of as many points as tell it clearly, or to a relative ``tolerance``, up to ``most``.
    """
    if not loaded_pads(ready.scene):
        return Mechanics(None, 0.0)
    points = DEVIATION_POINTS
    while True:
        before, changes = mechanics_deviations(ready.scene, lambda: _powers(ready, seed, points))  # noqa: B023
        power = before.mean(axis=0)
        if changes is None:
            return Mechanics(np.full_like(power, math.nan), math.nan)
        deviation = combined(changes.mean(axis=1))
        noise = mechanics_share(np.hypot(*map(standard_error, changes)), power)
        share = mechanics_share(deviation, power)
        more = _more_points(share, noise, tolerance)
        if more == 1 or points >= most:
            return Mechanics(deviation, share)
        points = min(points * more, most)


def _more_points(share: float, noise: float, tolerance: float) -> int:
    """How many times the points a share with so much noise takes to be clear, or known to a tolerance."""
    wanted = max(CLEAR * share, tolerance)
    if noise <= wanted:
        return 1
    return 1 << min(math.ceil(2 * math.log2(noise / wanted)) if wanted else 4, 4)


def deviation_points(clock: Clock | None, points: int = MOST_POINTS) -> int:
    """The most that the traces for the mechanics' error may take, beside readings of so many points."""
    if clock is not None and clock.end < math.inf:
        return DEVIATION_POINTS
    return min(points // DEVIATION_SHARE, MOST_DEVIATION_POINTS)


def geometry_points(points: int) -> int:
    """The most that the traces for the facets' error may take, beside readings of so many points."""
    return min(max(points // GEOMETRY_SHARE, GEOMETRY_POINTS), FIRST_POINTS)


def _powers(ready: Prepared, seed: int, points: int) -> np.ndarray:
    run = Run(ready, seed)
    run.go_on(points)
    return run.powers


def aim(scene: Any, target_error: float, seed: int, clock: Clock | None = None) -> Aimed:
    """Make a scene ready so that the total error of its worst taxel reaches a target.

    Parameters
    ----------
    scene : Any
        What :func:`prepare` takes; only a `Scene` that leaves the mesh of its pads open gets a finer one.
    target_error : float
        Relative; where it is out of reach of the mechanics, the light still gets a share of it.
    clock : Clock, optional
        What would not end in time is not begun.
    """
    scene = described(scene)
    ready, seconds = _timed(scene)
    traced = deviation_points(clock), NEGLIGIBLE * target_error
    mechanics, geometry = mechanics_of(ready, seed, *traced), geometry_of(ready, seed, tolerance=traced[1])
    tried: list[tuple[float, float]] = []
    for _ in range(MOST_MESHES if isinstance(scene, Scene) else 0):
        tried.append((smallest_mesh_size(ready), math.hypot(mechanics.share, geometry.share)))
        finer = finer_mesh(scene, ready, tried, target_error)
        if finer is None or (clock and not clock.allows(2 * seconds * (tried[-1][0] / finer) ** COST_ORDER)):
            break
        candidate = scene.with_mesh_size(finer)
        try:
            ready, seconds = _timed(candidate)
        except ComputationError:  # on a finer mesh the load path may end a little earlier
            break
        scene = candidate
        mechanics, geometry = mechanics_of(ready, seed, *traced), geometry_of(ready, seed, tolerance=traced[1])
    known = math.hypot(0.0 if math.isnan(mechanics.share) else mechanics.share, geometry.share)
    left = math.sqrt(max(target_error**2 - known**2, (LIGHT_SHARE * target_error) ** 2))
    points = points_for(ready, left, seed, clock, geometry.pilot)
    settings = Settings(points, scene.mesh_size if isinstance(scene, Scene) else None)
    return Aimed(ready, mechanics, geometry, settings)


def _timed(scene: Any) -> tuple[Prepared, float]:
    """A scene made ready, and the seconds for it where nothing had been solved before."""
    with stages.record() as seconds:
        ready = prepare(scene)
        with stages.stage("mechanics"):
            solved = sum(pad.state.seconds for pad in loaded_pads(ready.scene))
    return ready, max(sum(seconds.values()), solved)


def _refinable(ready: Prepared) -> list[Any]:
    """The pads that smaller elements make more accurate."""
    return [*loaded_pads(ready.scene), *curved_pads(ready.scene)]


def smallest_mesh_size(ready: Prepared) -> float:
    """mm, the smallest of all pads; infinite where there are none."""
    return min((float(pad.mesh_size or pad.pad.default_mesh_size) for pad in _refinable(ready)), default=math.inf)


def finer_mesh(scene: Scene, ready: Prepared, tried: list[tuple[float, float]], target_error: float) -> float | None:
    """Next mesh size in mm; None where the shape is good enough, or its mesh is not to be chosen.

    Parameters
    ----------
    tried : list[tuple[float, float]]
        Mesh sizes in mm and the errors found on them, the present one last.
    """
    wanted_error = MECHANICS_SHARE * target_error
    size, error = tried[-1]
    if not scene.leaves_mesh_open or error <= wanted_error:
        return None
    wanted = size * RUNG ** rungs_to(wanted_error, tried)
    elements = max(len(pad.state.mesh.tets) for pad in _refinable(ready)) * (size / wanted) ** 3
    return None if elements > MOST_ELEMENTS else wanted


def rungs_to(wanted_error: float, tried: list[tuple[float, float]]) -> int:
    """How many rungs below the last of the mesh sizes ``tried`` an error is the wanted one or less, so far as is known.

    Errors scatter from one mesh to the next: what is expected is the geometric mean of all that were found, each taken
    to the last size. Of an error that is unknown a finer mesh tells more.
    """
    last = tried[-1][0]
    known = [math.log(error) + ORDER * math.log(last / size) for size, error in tried if not math.isnan(error)]
    if math.isnan(tried[-1][1]):
        return MOST_RUNGS
    rungs = (math.log(wanted_error) - sum(known) / len(known)) / (ORDER * math.log(RUNG))
    return min(max(math.ceil(rungs), 1), MOST_RUNGS)


def points_for(
    ready: Prepared, target_error: float, seed: int, clock: Clock | None = None, first: Run | None = None
) -> int:
    """Points for each taxel and replicate that reach a relative standard error of the light, found by pilot runs.

    ``first`` is the first of them, if it is known already.
    """
    points = FIRST_POINTS
    for pilot in range(1, 16):
        run = first or Run(ready, derived_seed(seed, pilot))
        run.go_on(points)
        first = None
        error = _safety(run.powers) * Readings(run.powers, run.points, seed).relative_error
        if error <= target_error or points >= MOST_POINTS:
            break
        if clock and not clock.allows(8 * run.seconds):
            return MOST_POINTS  # out of reach: the clock says when to stop
        # The error falls at most as the number of points grows: it takes so many doublings, or more.
        doublings = max(1, math.floor(math.log2(min(error / target_error, 16.0))))
        points = min(points << doublings, MOST_POINTS)
    return points


def _safety(powers: np.ndarray) -> float:
    """What the error of the worst taxel is multiplied with: the worst of several is too large already.

    Of T numbers with a scatter about one mean, the largest exceeds it by about Phi^-1((T - 3/8) / (T + 1/4)) times that
    (G. Blom, Statistical Estimates and Transformed Beta-Variables, 1958).
    """
    lit = max(int(np.count_nonzero(powers.mean(axis=0) > 0)), 1)
    return _SAFETY - _SCATTER * NormalDist().inv_cdf((lit - 0.375) / (lit + 0.25))
