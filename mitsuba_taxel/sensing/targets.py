"""Choice of mesh size and number of light paths for a target error.

The target is a bound on the total error: the root of the sum of squares of the errors due to the pad's shape (finite
elements and flat triangles) and the light. Elements, and with them the triangles of curved walls, are refined until the
error of the shape is below its fraction of the target; the light may use the rest. Light without random numbers has no
noise, and a pad without a load has no error of mechanics: the target is divided among the errors that exist. Mesh size
and number of points follow from pilot runs, whose random numbers do not enter the result.
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
from mitsuba_taxel.sensing.reading.facets import (
    curved_pads,
    has_random_heights,
    tilt_share,
    with_blunt_heights,
    with_chords,
)
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
from mitsuba_taxel.sensing.validity.checked import known_points
from mitsuba_taxel.specification.taxel_tracer import TaxelTracer

TRUSTED = 0.01
"""Largest relative error of light without random numbers that is used. Above it, the response on a wall close to its
package is not resolved, and an error of 15 % is estimated as 6 %."""
MECHANICS_SHARE = 0.85
"""Fraction of a target error for the shape, if the light has noise. The light gets the smaller part, because more
points cost little: its error falls nearly as 1 / points."""
DARK_POINTS = 1 << 16
"""Number of points per taxel and replicate after which a scene without light counts as dark. If a roof rests on a
package, no more points are traced, because little light passes."""
DEVIATION_POINTS, MOST_DEVIATION_POINTS = 256, 1 << 14
"""Number of points per taxel and replicate of the first and of the longest traces for the error of the mechanics; domes
need many points."""
DEVIATION_SHARE = 4
"""Number of points of a reading, relative to the longest of these traces: a change has a fifth of the noise of a
reading."""
GEOMETRY_POINTS = 64
"""Number of points of the first traces for the error due to facets, which the first pilot run continues."""
GEOMETRY_SHARE = 8
"""Number of points of a reading, relative to each of the two longest traces for the error due to facets."""
CLEAR, NEGLIGIBLE = 1 / 3, 0.2
"""Largest uncertainty of the estimated error due to mechanics or facets, relative to this error, and relative to a
target error."""
_MOST_MORE = 16
"""Largest factor of the number of points from one of these traces to the next."""
COST_ORDER = 4.0
"""The time of the mechanics is proportional to the inverse element size to this power."""
RUNG, MOST_RUNGS = 0.9, 7
"""Element sizes are powers of this ratio times the first size, so that studies reuse solutions; and largest number of
such reductions (rungs) at a time. A rung changes the error by a seventh, so that a mesh is not much finer than
needed."""
MOST_MESHES = 4
"""Largest number of refinements."""
MOST_ELEMENTS = 250_000
"""Largest number of elements of a pad; a quarter of the paper's pad with this number takes about four gigabytes."""

_SCATTER, _SAFETY = 0.13, 1.3
"""Relative standard deviation of a standard error from 32 replicates; and safety factor with which the error is below
the target in nearly all scenes."""


def geometry_of(ready: Prepared, seed: int, most: int = FIRST_POINTS, tolerance: float = 0.0) -> FacetsEstimate:
    """Estimate the error of a scene's readings due to the flat triangles (facets) of curved and rough walls. Their
    positions and random heights each take a further short trace; the effect of their tilts is estimated without one.

    The number of points is chosen as in :func:`mechanics_of`.

    Parameters
    ----------
    ready : Prepared
        The scene.
    seed : int
        Seed of the random numbers.
    most : int
        Largest number of points per taxel and replicate.
    tolerance : float
        Noise of the estimate, relative to the readings, below which no further points are traced.

    Returns
    -------
    FacetsEstimate
        Changes of readings in W due to positions, heights and tilts, the relative error, and the pilot run.
    """
    is_curved, is_random = bool(curved_pads(ready.scene)), has_random_heights(ready.scene)
    if not (is_curved or is_random):
        return FLAT
    ready = ready._replace(paired=None)  # triangles of this scene are moved, not those of its base state
    tilt = tilt_share(ready.scene) if is_curved else 0.0
    movements = [with_chords] * is_curved + [with_blunt_heights] * is_random
    pilot, *runs = (Run(ready, derived_seed(seed, 1)) for _ in range(1 + len(movements)))
    points = GEOMETRY_POINTS
    while True:
        pilot.extend_to(points)
        power, facets, factor = pilot.powers.mean(axis=0), [], 1
        for movement, run in zip(movements, runs, strict=True):
            with movement(ready.scene):
                run.extend_to(points)
            changes = run.powers - pilot.powers
            facets.append(changes.mean(axis=0))
            error, noise = (geometry_share(change, power) for change in (facets[-1], standard_error(changes)))
            factor = max(factor, _factor_of_points(error, noise, tolerance))
        if factor == 1 or points >= most:
            if is_random:  # this change may be below its noise, which is then the stated error
                facets[-1] = np.copysign(np.hypot(facets[-1], standard_error(changes)), facets[-1])
            all_of_them = np.sqrt(sum(np.square([*facets, tilt / FACETS_SHARE * power])))
            heights = geometry_share(facets[-1], power) if is_random else 0.0
            signed = np.copysign(all_of_them, facets[0])
            return FacetsEstimate(signed, geometry_share(signed, power), pilot, heights)
        points = min(points * factor, most)


def without_random_numbers(ready: Prepared, mechanics_error: bool = True) -> ShapeErrors | None:
    """Compute the readings of diffuse cells, and their errors, without random numbers.

    The returned error of the geometry is that of the discretised light: patches and quadrature.

    Parameters
    ----------
    ready : Prepared
        The scene.
    mechanics_error : bool
        Whether to compute the readings on coarser finite elements as well, for the error of the mechanics.

    Returns
    -------
    ShapeErrors or None
        Readings in W and their errors; None if the scene needs random paths.
    """
    tracer = getattr(ready.integrator, "specification", None)
    all_paths = isinstance(tracer, TaxelTracer) and tracer.max_depth < 0 and tracer.strategy == "all"
    if not all_paths or len(deformed_pads(ready.scene)) != 1:
        return None
    from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light  # imports the solvers

    light = deterministic_light(ready.scene, mechanics_error)
    if light is None or not np.all(light.error <= TRUSTED * light.power):
        return None
    mechanics, facets = MechanicsEstimate(None, 0.0), light.error / FACETS_SHARE
    if light.deviation is not None:
        mechanics = MechanicsEstimate(light.deviation, mechanics_share(light.deviation, light.power))
    return ShapeErrors(mechanics, FacetsEstimate(facets, geometry_share(facets, light.power), None), light.power)


def mechanics_of(ready: Prepared, seed: int, most: int = DEVIATION_POINTS, tolerance: float = 0.0) -> MechanicsEstimate:
    """Estimate the error of a scene's readings due to the finite elements, from three short traces, or four with
    mirrors.

    Parameters
    ----------
    ready : Prepared
        The scene.
    seed : int
        Seed of the random numbers.
    most : int
        Largest number of points per taxel and replicate; fewer are traced if they resolve the error.
    tolerance : float
        Noise of the estimate, relative to the readings, below which no further points are traced.

    Returns
    -------
    MechanicsEstimate
        Changes of readings in W and the relative error; NaN if the error of the mechanics is unknown.
    """
    if not loaded_pads(ready.scene):
        return MechanicsEstimate(None, 0.0)
    points = DEVIATION_POINTS
    while True:
        if ready.paired is not None:
            before, changes = ready.paired.deviations(seed, points)
        else:
            before, changes = mechanics_deviations(ready.scene, lambda: _powers(ready, seed, points))  # noqa: B023
        power = before.mean(axis=0)
        if changes is None:
            return MechanicsEstimate(np.full_like(power, math.nan), math.nan)
        deviation = combined(changes.mean(axis=1))
        noise = mechanics_share(np.linalg.norm(list(map(standard_error, changes)), axis=0), power)
        error = mechanics_share(deviation, power)
        # A dark taxel below a roof that rests on a package: its error is the light that the paths may have missed.
        dark = ~(before.any(axis=0) | changes.any(axis=(0, 1)))
        shut = dark.any() and is_touched(ready.scene)
        factor = _MOST_MORE if shut else _factor_of_points(error, noise, tolerance)
        if factor == 1 or points >= most:
            if shut:
                missed = dark_errors(ready.scene, ready.integrator, points * len(before), len(power)) / ERROR_SHARE
                deviation = np.where(dark, missed, deviation)
            return MechanicsEstimate(deviation, error)
        points = min(points * factor, most)


def _factor_of_points(error: float, noise: float, tolerance: float) -> int:
    """Factor by which the number of points must grow until the noise of an error estimate is below a third of the
    estimate, or below ``tolerance``."""
    largest = max(CLEAR * error, tolerance)
    if noise <= largest:
        return 1
    return min(1 << math.ceil(2 * math.log2(noise / largest)), _MOST_MORE) if largest else _MOST_MORE


def deviation_points(clock: Clock | None, points: int = MOST_POINTS) -> int:
    """Largest number of points of the short traces that estimate the error of the mechanics.

    Parameters
    ----------
    clock : Clock or None
        Time budget of the run; with a finite budget, only the first, shortest traces are made.
    points : int
        Points of the readings.

    Returns
    -------
    int
        Number of points per taxel and replicate.
    """
    if clock is not None and clock.end < math.inf:
        return DEVIATION_POINTS
    return min(points // DEVIATION_SHARE, MOST_DEVIATION_POINTS)


def geometry_points(points: int) -> int:
    """Largest number of points of the short traces that estimate the error due to facets, from the number of points of
    the readings."""
    return min(max(points // GEOMETRY_SHARE, GEOMETRY_POINTS), FIRST_POINTS)


def _powers(ready: Prepared, seed: int, points: int) -> np.ndarray:
    run = Run(ready, seed)
    run.extend_to(points)
    return run.powers


def prepare_for(
    scene: AnyScene, target_error: float, seed: int, clock: Clock | None = None, random: bool = False
) -> PreparedFor:
    """Choose the mesh of a scene and the number of light paths such that the total error of every taxel reaches a
    target.

    Parameters
    ----------
    scene : AnyScene
        See :func:`prepare`; only a `Scene` that does not fix the mesh of its pads gets a finer one.
    target_error : float
        Relative total error. If the mechanics cannot reach it, the light still reaches its own fraction of it.
    seed : int
        Seed of the random numbers of pilot runs.
    clock : Clock, optional
        Steps that would not end in time are not started.
    random : bool
        Whether light is to be computed by random paths in any case, as for an irradiance map.

    Returns
    -------
    PreparedFor
        The scene, its errors due to the shape, and the mesh size and number of points for the reading.
    """
    scene = described(scene)
    ready, seconds = _timed(scene)
    alternative: PreparedFor | None = None  # readings without random numbers, with the smallest error of all meshes
    deterministic = not random
    meshes: list[tuple[float, float]] = []
    while True:
        # Errors on this mesh: without random numbers if that suffices for the target, else by pilot runs of the light.
        certain = without_random_numbers(ready) if deterministic else None
        deterministic &= bool(loaded_pads(ready.scene))  # elements do not change readings without a load
        if certain is not None:
            smallest = math.nan if alternative is None else alternative.errors.share
            if certain.share < smallest or math.isnan(smallest):
                alternative = prepared_without_random_numbers(ready, scene, certain)
        if certain is not None and certain.suffices(target_error):
            errors = certain
        else:
            tolerance = NEGLIGIBLE * target_error
            mechanics = mechanics_of(ready, seed, deviation_points(clock), tolerance)
            errors = ShapeErrors(mechanics, geometry_of(ready, seed, tolerance=tolerance))

        # The next mesh, if the error of the shape is above its fraction of the target. Elements do not change the error
        # of light without random numbers.
        if len(meshes) == MOST_MESHES or not isinstance(scene, Scene):
            break
        if errors.power is None:
            target, error = MECHANICS_SHARE * target_error, errors.refinable_share
        else:
            target, error = math.sqrt(max(target_error**2 - errors.light_share**2, 0.0)), errors.mechanics.share
        meshes.append((smallest_mesh_size(ready), error))
        finer = finer_mesh(scene, ready, meshes, target)
        if finer is None or (clock and not clock.allows(2 * seconds * (meshes[-1][0] / finer) ** COST_ORDER)):
            break
        candidate = scene.with_mesh_size(finer)
        try:
            ready, seconds = _timed(candidate)
        except ComputationError:  # on a finer mesh the load path may end a little earlier
            break
        scene = candidate

    # The light may use the rest of the target, with as many points as needed, unless readings without random numbers
    # are at least as good.
    if alternative is not None and errors.power is not None:
        return alternative
    shape = errors.known_share
    light = math.sqrt(max(target_error**2 - shape**2, (LIGHT_SHARE * target_error) ** 2))
    without_noise = math.inf if alternative is None else math.sqrt(max(alternative.errors.known_share**2 - shape**2, 0))
    points = points_for(ready, light, clock, errors.geometry.pilot, without_noise)
    if alternative is not None and not points:
        return alternative
    return PreparedFor(ready, errors, Settings(points, mesh_size_of(scene)), light, alternative)


def _timed(scene: AnyScene) -> tuple[Prepared, float]:
    """Prepare a scene without cached solutions. Returns the prepared scene and the seconds that this takes."""
    with stages.record() as seconds:
        ready = prepare(scene)
        with stages.stage("mechanics"):
            solved = sum(pad.state.seconds for pad in loaded_pads(ready.scene))
    return ready, max(sum(seconds.values()), solved)


def _refinable(ready: Prepared) -> list[PadShape]:
    """The pads of a scene whose errors fall with smaller elements."""
    return [*loaded_pads(ready.scene), *curved_pads(ready.scene)]


def smallest_mesh_size(ready: Prepared, loaded: bool = False) -> float:
    """Smallest mesh size among the pads of a scene whose readings depend on their elements.

    Parameters
    ----------
    ready : Prepared
        The scene.
    loaded : bool
        Whether to return the mesh sizes that the pads would have under a load.

    Returns
    -------
    float
        Mesh size in mm; infinite if there are no such pads.
    """
    sizes = (
        (pad.loaded_mesh_size if loaded else pad.mesh_size) or pad.pad.default_mesh_size for pad in _refinable(ready)
    )
    return min(map(float, sizes), default=math.inf)


def finer_mesh(
    scene: Scene, ready: Prepared, meshes: list[tuple[float, float]], target: float, order: float = ORDER
) -> float | None:
    """Choose the next smaller mesh size on the way to a target error.

    Parameters
    ----------
    scene : Scene
        Description of the scene.
    ready : Prepared
        The loaded scene.
    meshes : list[tuple[float, float]]
        Mesh sizes in mm and the relative errors on them, the present mesh last.
    target : float
        Relative error.
    order : float
        Order of convergence: errors are proportional to the mesh size to this power.

    Returns
    -------
    float or None
        Mesh size in mm; None if the error is below the target, if the scene fixes the mesh, or if the next mesh would
        have too many elements.
    """
    size, error = meshes[-1]
    if not scene.leaves_mesh_open or error <= target:
        return None
    finer = size * RUNG ** rungs_to(target, meshes, order)
    elements = max(len(pad.state.mesh.tets) for pad in _refinable(ready)) * (size / finer) ** 3
    return None if elements > MOST_ELEMENTS else finer


def rungs_to(target: float, meshes: list[tuple[float, float]], order: float = ORDER) -> int:
    """Estimate how often the mesh size must be reduced by the factor `RUNG` until the error reaches the target.

    Errors scatter from one mesh to the next. The present error is therefore taken as the geometric mean of the errors
    on all meshes, each scaled to the last mesh size.

    Parameters
    ----------
    target : float
        Relative error to reach.
    meshes : list[tuple[float, float]]
        Mesh sizes in mm and the relative errors on them, NaN if unknown; the present mesh is last.
    order : float
        Order of convergence: errors are proportional to the mesh size to this power.

    Returns
    -------
    int
        Number from 1 to `MOST_RUNGS`; `MOST_RUNGS` if the last error is unknown.
    """
    last = meshes[-1][0]
    scaled = [math.log(error) + order * math.log(last / size) for size, error in meshes if not math.isnan(error)]
    if math.isnan(meshes[-1][1]):
        return MOST_RUNGS
    rungs = (math.log(target) - sum(scaled) / len(scaled)) / (order * math.log(RUNG))
    return min(max(math.ceil(rungs), 1), MOST_RUNGS)


def points_for(
    ready: Prepared,
    target_error: float,
    clock: Clock | None = None,
    first: Run | None = None,
    known_error: float = math.inf,
) -> int:
    """Estimate, by a pilot run, the number of points per taxel and replicate for a relative standard error of the
    light.

    If a pad touches a package, the result is at most :data:`DARK_POINTS`.

    Parameters
    ----------
    ready : Prepared
        The scene.
    target_error : float
        Relative target error.
    clock : Clock, optional
        Time budget. If its time does not suffice, the result is `MOST_POINTS`, so that the clock ends the run.
    first : Run, optional
        A pilot run to continue. Without it, the pilot run always has the same seed, and its result is cached with the
        scene.
    known_error : float
        Relative error of readings computed without random numbers. The result is 0 if random paths would not reach a
        smaller error in time.

    Returns
    -------
    int
        A power of two, or 0.
    """
    remembered = known_points(ready.scene) if first is None else {}
    if target_error in remembered:
        return remembered[target_error]
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
    remembered[target_error] = points
    return points


def _safety(powers: np.ndarray) -> float:
    """Safety factor for the error that a pilot run predicts for the worst taxel. It is smaller for many taxels, because
    the largest of several estimated errors is biased upwards.

    The largest of T numbers exceeds their mean by about Phi^-1((T - 3/8) / (T + 1/4)) times their standard deviation
    (G. Blom, Statistical Estimates and Transformed Beta-Variables, 1958).
    """
    lit = max(int(np.count_nonzero(powers.mean(axis=0) > 0)), 1)
    return _SAFETY - _SCATTER * NormalDist().inv_cdf((lit - 0.375) / (lit + 0.25))
