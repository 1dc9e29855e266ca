"""Mesh size and number of points for a target error.

The target applies to the root of the sum of squares of both errors. Elements, and with them the triangles of curved
walls, are refined until the shape's error is within its share; the light gets the rest. Light without random numbers
needs none, and a pad without a load has no error of the mechanics: a target is shared among the errors that exist.
Both are determined by pilot runs, whose random numbers do not enter the result.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE, FACETS_SHARE, ORDER
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.sensing.reading.darkness import dark_errors, may_be_lit
from mitsuba_taxel.sensing.reading.facets import curved_pads, tilt_share, with_chords
from mitsuba_taxel.sensing.reading.mechanics_error import combined, mechanics_deviations
from mitsuba_taxel.sensing.reading.prepared_scenes import (
    FLAT,
    LIGHT_SHARE,
    FacetsEstimate,
    MechanicsEstimate,
    PreparedFor,
    Settings,
    ShapeErrors,
    mesh_size_of,
    prepared_without_random_numbers,
)
from mitsuba_taxel.sensing.reading.readings import Readings, geometry_share, mechanics_share
from mitsuba_taxel.sensing.reading.runs import (
    FIRST_POINTS,
    MOST_POINTS,
    AnyScene,
    Clock,
    Prepared,
    Run,
    derived_seed,
    described,
    prepare,
)
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads, is_touched, loaded_pads
from mitsuba_taxel.sensing.validity.checked import found_points
from mitsuba_taxel.specification.taxel_tracer import TaxelTracer

TRUSTED = 0.01
"""Relative error above which light without random numbers is not used: the response on a wall close above its package
is not resolved, and errors of 15 % are taken for 6 %."""
MECHANICS_SHARE = 0.85
"""Share of the shape in a target error where light has noise. More points cost little: the error of a scrambled net
falls nearly as 1/points."""
DARK_POINTS = 1 << 16
"""Points per taxel and replicate after which a scene in which no light was found counts as dark, and most of them where
a roof rests on a package: what still passes is little."""
DEVIATION_POINTS, MOST_DEVIATION_POINTS = 256, 1 << 14
"""Points per taxel and replicate of the traces for the mechanics' error, first and at most: domes need many."""
DEVIATION_SHARE = 4
"""A reading's points over the most in these traces: a change has a fifth of the noise of a reading."""
GEOMETRY_POINTS = 64
"""Least points of the traces for the facets' error: those of the first pilot run, which continues from them."""
GEOMETRY_SHARE = 8
"""A reading's points over the most in each of the two traces for the facets' error."""
CLEAR, NEGLIGIBLE = 1 / 3, 0.2
"""Allowed uncertainty of the error of mechanics or facets, relative to itself, or to a target error."""
_MOST_MORE = 16
"""Largest factor on the points from one of these traces to the next."""
COST_ORDER = 4.0
"""Power of the element size with which the time of the mechanics grows."""
RUNG, MOST_RUNGS = 0.9, 7
"""Element sizes form a ladder, so that studies share solutions; largest number of rungs per step. A rung changes the
error by a seventh, so that the mesh is not much finer than needed."""
MOST_MESHES = 4
MOST_ELEMENTS = 250_000
"""Most elements of a pad; a quarter of the paper's with as many takes about four gigabytes."""

_SCATTER, _SAFETY = 0.13, 1.3
"""A standard error from 32 replicates is itself known to 13 %, and should stay below the target in nearly all
scenes."""


def geometry_of(ready: Prepared, seed: int, most: int = FIRST_POINTS, tolerance: float = 0.0) -> FacetsEstimate:
    """Error of a scene's readings by facets: of their positions, from two short traces, of as many points as in
    :func:`mechanics_of`, and of their tilts.

    Parameters
    ----------
    ready : Prepared
        The scene.
    seed : int
        Of the random numbers.
    most : int
        Points that are traced at most.
    tolerance : float
        Relative error at which more points are not needed.

    Returns
    -------
    FacetsEstimate
        Changes of readings in W with that of tilts, their relative error, and the pilot run.
    """
    if not curved_pads(ready.scene):
        return FLAT
    tilt = tilt_share(ready.scene)
    pilot, chords = (Run(ready, derived_seed(seed, 1)) for _ in range(2))
    points = GEOMETRY_POINTS
    while True:
        pilot.extend_to(points)
        with with_chords(ready.scene):
            chords.extend_to(points)
        changes, power = chords.powers - pilot.powers, pilot.powers.mean(axis=0)
        facets = changes.mean(axis=0)
        share, noise = (geometry_share(change, power) for change in (facets, standard_error(changes)))
        more = _more_points(share, noise, tolerance)
        if more == 1 or points >= most:
            both = np.copysign(np.hypot(facets, tilt / FACETS_SHARE * power), facets)
            return FacetsEstimate(both, geometry_share(both, power), pilot)
        points = min(points * more, most)


def without_random_numbers(ready: Prepared, mechanics_error: bool = True) -> ShapeErrors | None:
    """Readings of diffuse cells and their errors; None if the scene needs random paths.

    What discretises the light is part of the geometry.

    Parameters
    ----------
    ready : Prepared
        The scene.
    mechanics_error : bool
        Whether to read the pad on coarser finite elements as well.

    Returns
    -------
    ShapeErrors or None
        None if the scene needs random paths.
    """
    stated = getattr(ready.integrator, "specification", None)
    followed = isinstance(stated, TaxelTracer) and stated.max_depth < 0 and stated.strategy == "all"
    if not followed or len(deformed_pads(ready.scene)) != 1:
        return None
    from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light  # imports the solvers

    found = deterministic_light(ready.scene, mechanics_error)
    if found is None or not np.all(found.error <= TRUSTED * found.power):
        return None
    mechanics, facets = MechanicsEstimate(None, 0.0), found.error / FACETS_SHARE
    if found.deviation is not None:
        mechanics = MechanicsEstimate(found.deviation, mechanics_share(found.deviation, found.power))
    return ShapeErrors(mechanics, FacetsEstimate(facets, geometry_share(facets, found.power), None), found.power)


def mechanics_of(ready: Prepared, seed: int, most: int = DEVIATION_POINTS, tolerance: float = 0.0) -> MechanicsEstimate:
    """Error of a scene's readings by that of the mechanics, from three short traces.

    Their number of points is chosen to resolve it, or to reach a relative ``tolerance``, up to ``most``.
    """
    if not loaded_pads(ready.scene):
        return MechanicsEstimate(None, 0.0)
    points = DEVIATION_POINTS
    while True:
        before, changes = mechanics_deviations(ready.scene, lambda: _powers(ready, seed, points))  # noqa: B023
        power = before.mean(axis=0)
        if changes is None:
            return MechanicsEstimate(np.full_like(power, math.nan), math.nan)
        deviation = combined(changes.mean(axis=1))
        noise = mechanics_share(np.hypot(*map(standard_error, changes)), power)
        share = mechanics_share(deviation, power)
        dark = ~(before.any(axis=0) | changes.any(axis=(0, 1)))
        more = _MOST_MORE if dark.any() and is_touched(ready.scene) else _more_points(share, noise, tolerance)
        if more == 1 or points >= most:
            if dark.any() and is_touched(ready.scene):  # what as many paths may have missed
                missed = dark_errors(ready.scene, ready.integrator, points * len(before), len(power)) / ERROR_SHARE
                deviation = np.where(dark, missed, deviation)
            return MechanicsEstimate(deviation, share)
        points = min(points * more, most)


def _more_points(share: float, noise: float, tolerance: float) -> int:
    """Factor on the points after which a share with this noise is resolved, or known to a tolerance."""
    wanted = max(CLEAR * share, tolerance)
    if noise <= wanted:
        return 1
    return min(1 << math.ceil(2 * math.log2(noise / wanted)), _MOST_MORE) if wanted else _MOST_MORE


def deviation_points(clock: Clock | None, points: int = MOST_POINTS) -> int:
    """Most points of the traces for the mechanics' error, for readings of this many points."""
    if clock is not None and clock.end < math.inf:
        return DEVIATION_POINTS
    return min(points // DEVIATION_SHARE, MOST_DEVIATION_POINTS)


def geometry_points(points: int) -> int:
    """Most points of the traces for the facets' error, for readings of this many points."""
    return min(max(points // GEOMETRY_SHARE, GEOMETRY_POINTS), FIRST_POINTS)


def _powers(ready: Prepared, seed: int, points: int) -> np.ndarray:
    run = Run(ready, seed)
    run.extend_to(points)
    return run.powers


def prepare_for(
    scene: AnyScene, target_error: float, seed: int, clock: Clock | None = None, random: bool = False
) -> PreparedFor:
    """Prepare a scene such that the total error of its worst taxel reaches a target.

    Parameters
    ----------
    scene : AnyScene
        As for :func:`prepare`; only a `Scene` that does not fix the mesh of its pads gets a finer one.
    target_error : float
        Relative; if the mechanics cannot reach it, the light still gets a share of it.
    seed : int
        Of the random numbers of pilot runs.
    clock : Clock, optional
        Steps that would not end in time are not started.
    random : bool
        Whether light needs random paths, as for a map, even where readings do not.

    Returns
    -------
    PreparedFor
        The scene, and what is known of its errors.
    """
    scene = described(scene)
    ready, seconds = _timed(scene)
    alternative: PreparedFor | None = None  # of the meshes so far, that with the smallest error
    quiet = not random

    def judged() -> ShapeErrors:
        nonlocal alternative, quiet
        certain = without_random_numbers(ready) if quiet else None
        quiet &= bool(loaded_pads(ready.scene))  # without a load, elements do not change it
        if certain is not None:
            least = math.nan if alternative is None else alternative.errors.share
            if certain.share < least or math.isnan(least):
                alternative = prepared_without_random_numbers(ready, scene, certain)
            if certain.suffices(target_error):
                return certain
        tolerance = NEGLIGIBLE * target_error
        mechanics = mechanics_of(ready, seed, deviation_points(clock), tolerance)
        return ShapeErrors(mechanics, geometry_of(ready, seed, tolerance=tolerance))

    errors = judged()
    tried: list[tuple[float, float]] = []
    for _ in range(MOST_MESHES):
        if not isinstance(scene, Scene):
            break
        if errors.power is None:
            wanted, share = MECHANICS_SHARE * target_error, errors.share
        else:  # elements do not change the error of the light
            wanted, share = math.sqrt(max(target_error**2 - errors.light_share**2, 0.0)), errors.mechanics.share
        tried.append((smallest_mesh_size(ready), share))
        finer = finer_mesh(scene, ready, tried, wanted)
        if finer is None or (clock and not clock.allows(2 * seconds * (tried[-1][0] / finer) ** COST_ORDER)):
            break
        candidate = scene.with_mesh_size(finer)
        try:
            ready, seconds = _timed(candidate)
        except ComputationError:  # on a finer mesh the load path may end a little earlier
            break
        scene = candidate
        errors = judged()
    if alternative is not None and errors.power is not None:
        return alternative
    known = errors.known_share
    light = math.sqrt(max(target_error**2 - known**2, (LIGHT_SHARE * target_error) ** 2))
    at_hand = math.inf if alternative is None else math.sqrt(max(alternative.errors.known_share**2 - known**2, 0))
    points = points_for(ready, light, clock, errors.geometry.pilot, at_hand)
    if alternative is not None and not points:
        return alternative
    return PreparedFor(ready, errors, Settings(points, mesh_size_of(scene)), light, alternative)


def _timed(scene: AnyScene) -> tuple[Prepared, float]:
    """A prepared scene, and the seconds that it takes without cached solutions."""
    with stages.record() as seconds:
        ready = prepare(scene)
        with stages.stage("mechanics"):
            solved = sum(pad.state.seconds for pad in loaded_pads(ready.scene))
    return ready, max(sum(seconds.values()), solved)


def _refinable(ready: Prepared) -> list[PadShape]:
    """The pads that become more accurate with smaller elements."""
    return [*loaded_pads(ready.scene), *curved_pads(ready.scene)]


def smallest_mesh_size(ready: Prepared, loaded: bool = False) -> float:
    """Smallest mesh size of all pads in mm, or of them as if they were ``loaded``; infinite if there are none.

    Parameters
    ----------
    ready : Prepared
        The scene.
    loaded : bool
        Whether pads count as loaded.

    Returns
    -------
    float
        In mm.
    """
    sizes = (
        (pad.loaded_mesh_size if loaded else pad.mesh_size) or pad.pad.default_mesh_size for pad in _refinable(ready)
    )
    return min(map(float, sizes), default=math.inf)


def finer_mesh(
    scene: Scene, ready: Prepared, tried: list[tuple[float, float]], wanted_error: float, order: float = ORDER
) -> float | None:
    """Next mesh size in mm; None if the error is not above the wanted one, or the mesh is fixed.

    Parameters
    ----------
    scene : Scene
        As described.
    ready : Prepared
        The same, loaded.
    tried : list[tuple[float, float]]
        Mesh sizes in mm and the errors found on them, the present one last.
    wanted_error : float
        Relative.
    order : float
        Power of the mesh size with which errors fall.

    Returns
    -------
    float or None
        In mm.
    """
    size, error = tried[-1]
    if not scene.leaves_mesh_open or error <= wanted_error:
        return None
    wanted = size * RUNG ** rungs_to(wanted_error, tried, order)
    elements = max(len(pad.state.mesh.tets) for pad in _refinable(ready)) * (size / wanted) ** 3
    return None if elements > MOST_ELEMENTS else wanted


def rungs_to(wanted_error: float, tried: list[tuple[float, float]], order: float = ORDER) -> int:
    """Estimated number of rungs below the last of the mesh sizes ``tried`` at which the error is the wanted one.

    Errors scatter from one mesh to the next: the expected one is the geometric mean of all that were found, each scaled
    to the last size. If the last is unknown, a finer mesh is tried.
    """
    last = tried[-1][0]
    known = [math.log(error) + order * math.log(last / size) for size, error in tried if not math.isnan(error)]
    if math.isnan(tried[-1][1]):
        return MOST_RUNGS
    rungs = (math.log(wanted_error) - sum(known) / len(known)) / (order * math.log(RUNG))
    return min(max(math.ceil(rungs), 1), MOST_RUNGS)


def points_for(
    ready: Prepared,
    target_error: float,
    clock: Clock | None = None,
    first: Run | None = None,
    known_error: float = math.inf,
) -> int:
    """Points per taxel and replicate for a relative standard error of the light, found by a pilot run.

    Where a pad touches a package, they are :data:`DARK_POINTS` at most.

    Parameters
    ----------
    ready : Prepared
        The scene.
    target_error : float
        Relative.
    clock : Clock, optional
        If its time does not suffice, the result is `MOST_POINTS`, and the clock decides.
    first : Run, optional
        The pilot run, if it has begun already. Else its random numbers are always the same, so that what it finds is
        that of the scene, and is found once.
    known_error : float
        Relative error without random numbers: the result is 0 if that of paths would not fall below it in time.

    Returns
    -------
    int
        A power of two, or 0.
    """
    found = found_points(ready.scene) if first is None else {}
    if target_error in found:
        return found[target_error]
    run = first or Run(ready, derived_seed(0, 1))
    points, most = FIRST_POINTS, DARK_POINTS if is_touched(ready.scene) else MOST_POINTS
    while True:
        halves = 2 if run.points else 1  # the last step of a run that is extended is half of it
        run.extend_to(points)
        error = _safety(run.powers) * Readings(run.powers, run.points, run.seed).relative_error
        if not run.powers.any() and points < DARK_POINTS and may_be_lit(ready.scene, ready.integrator):
            error = math.inf
        if error <= target_error or points >= most:
            break
        if clock and not clock.allows(8 * halves * run.seconds):
            # The error falls at most as 1/points, and so as 1/time.
            reached = error * halves * run.seconds / clock.left if clock.left > 0 else error
            return MOST_POINTS if reached < known_error else 0
        # At least this many doublings are needed.
        doublings = max(1, math.floor(math.log2(min(error / target_error, 16.0))))
        points = min(points << doublings, most)
    found[target_error] = points
    return points


def _safety(powers: np.ndarray) -> float:
    """Safety factor on the error of the worst taxel, less the bias of a maximum.

    The largest of T numbers that scatter about one mean exceeds it by about Phi^-1((T - 3/8) / (T + 1/4)) times the
    scatter (G. Blom, Statistical Estimates and Transformed Beta-Variables, 1958).
    """
    lit = max(int(np.count_nonzero(powers.mean(axis=0) > 0)), 1)
    return _SAFETY - _SCATTER * NormalDist().inv_cdf((lit - 0.375) / (lit + 0.25))
