"""Optical power on every phototransistor of a scene, with its error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.arguments import (
    check_flags,
    check_seed,
    check_whole,
    is_number,
    names_of,
    plain_number,
    require,
)
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.base.replicates import MOST_OF_SCATTER, largest_scatter_share
from mitsuba_taxel.kernels.paths.taxel_integrators import traces_taxels
from mitsuba_taxel.kernels.paths.wavefronts import trace
from mitsuba_taxel.kernels.walls import set_wavelength
from mitsuba_taxel.sensing.reading.darkness import dark_errors
from mitsuba_taxel.sensing.reading.finish_notes import finishes_of
from mitsuba_taxel.sensing.reading.mechanics_error import combined, mechanics_deviations, roof_errors
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.reading.prepared_scenes import (
    FLAT,
    MechanicsEstimate,
    PreparedFor,
    Settings,
    ShapeErrors,
    mesh_size_of,
    prepared_without_random_numbers,
)
from mitsuba_taxel.sensing.reading.readings import Crosstalk, Readings
from mitsuba_taxel.sensing.reading.runs import (
    CHOSEN_INTEGRATOR,
    FIRST_POINTS,
    MOST_POINTS,
    REPLICATES,
    AnyScene,
    Clock,
    Prepared,
    Run,
    described,
    prepare,
)
from mitsuba_taxel.sensing.reading.stretch_notes import exceeded_limits
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads, is_touched, loaded_pads
from mitsuba_taxel.sensing.scene.taxels import taxel_positions, taxels_of
from mitsuba_taxel.sensing.targets import (
    NEGLIGIBLE,
    deviation_points,
    geometry_of,
    geometry_points,
    mechanics_of,
    points_for,
    prepare_for,
    without_random_numbers,
)

if TYPE_CHECKING:
    from mitsuba_taxel.sensing.derivatives.scene_rates import Rates
    from mitsuba_taxel.sensing.reading.derivative_values import Derivatives

LIGHT_ERROR = 0.005
"""Default relative standard error of the light."""


# The scene must be deleted before another thread traces a scene: Dr.Jit would find its half-destroyed shapes.
@in_turn
def measure(
    scene: AnyScene,
    *,
    target_error: float | None = None,
    points: int | None = None,
    time_budget: float | None = None,
    seed: int = 0,
    irradiance: bool = False,
    mechanics_error: bool = True,
    continued: Readings | None = None,
    derivatives: Sequence[str] = (),
) -> Readings:
    """Compute the optical power on each phototransistor of a scene, with its errors.

    If all walls of the cells are diffuse, light is computed without random numbers. Random paths are used instead if
    the walls are not diffuse, if ``points``, ``irradiance`` or a time budget without a target is given, or if the
    scene's integrator is not a `taxel_tracer` of all paths. Calls from several threads run one after the other.

    Parameters
    ----------
    scene : Scene or str or Path or dict or mi.Scene or Prepared
        A :class:`Scene`, a path or name of an XML scene, a dictionary, a loaded ``mi.Scene``, or the result of
        :func:`prepare`.
    target_error : float, optional
        Relative total error, of mechanics and light, that every taxel should reach. Pads whose mesh the `Scene` does
        not fix are meshed finely enough. A pilot run chooses the number of points; its random numbers do not enter the
        result. If target, points and budget are all omitted, the relative error of the light alone is at most 0.005.
    points : int, optional
        Number of light paths for each taxel and replicate, instead of a target; rounded up to a power of two.
    time_budget : float, optional
        Seconds after which no finer mesh is solved and no further points are traced. Without a target or a number of
        points, the whole time is used; with one of them, the run ends at whichever limit is reached first. At least
        256 points are traced in any case.
    seed : int
        Whole number from 0 to 2**32 - 1.
    irradiance : bool
        Whether to return the map of irradiance over the phototransistors.
    mechanics_error : bool
        Whether to estimate the errors of readings due to finite elements and flat triangles; this takes further short
        traces.
    continued : Readings, optional
        Earlier readings of the same scene with the same seed and at least 256 points, which this run extends. With
        ``points``, the result equals that of a single run with this number of points (under Mitsuba's own integrators
        it is an equally good estimate).
    derivatives : Sequence[str]
        Names of the parameters with respect to which the readings are differentiated: parameters of the scene,
        components of the load (fx, fy, fz, ux, uy, uz), or parameters of its plugins, such as ``youngs_modulus`` or
        ``annular_led.power``. If all walls of the cells are diffuse, the derivatives have no noise; else they are
        differences of readings by random paths (see ``Derivatives.method``). The scene must be a `Scene`, a path or a
        name.

    Returns
    -------
    Readings
        Power on each phototransistor in W, with its errors; the irradiance map and derivatives if requested.

    Raises
    ------
    InputError
        if a value is not allowed, the scene cannot be built or read, or a derivative does not exist.
    ComputationError
        if a pad cannot bear its load.
    """
    return measured(
        scene, target_error, points, time_budget, seed, irradiance, mechanics_error, continued, derivatives
    )[0]


@in_turn
def measured(
    scene: AnyScene,
    target_error: float | None = None,
    points: int | None = None,
    time_budget: float | None = None,
    seed: int = 0,
    irradiance: bool = False,
    mechanics_error: bool = True,
    continued: Readings | None = None,
    derivatives: Sequence[str] = (),
) -> tuple[Readings, Prepared]:
    """Compute the readings of a scene as :func:`measure` does, and return the prepared scene too, so that it need not
    be loaded again.

    Parameters
    ----------
    scene : Scene or str or Path or dict or mi.Scene or Prepared
        Scene in any form that :func:`measure` takes.
    target_error : float, optional
        Relative total error that every taxel should reach, as for :func:`measure`.
    points : int, optional
        Number of light paths for each taxel and replicate, as for :func:`measure`.
    time_budget : float, optional
        Time in s after which nothing further is traced, as for :func:`measure`.
    seed : int
        Seed of the random numbers, as for :func:`measure`.
    irradiance : bool
        Whether the result has the map of irradiance over the phototransistors.
    mechanics_error : bool
        Whether errors due to finite elements and flat triangles are estimated.
    continued : Readings, optional
        Earlier readings of the same scene, which this run extends, as for :func:`measure`.
    derivatives : sequence of str
        Names of the parameters with respect to which the readings are differentiated.

    Returns
    -------
    readings : Readings
        Power on each phototransistor in W, with its errors; the irradiance map and derivatives if requested.
    ready : Prepared
        The scene.

    Raises
    ------
    InputError
        as :func:`measure`.
    ComputationError
        as :func:`measure`.
    """
    check_request(target_error, points, seed, time_budget, derivatives)
    target_error, points, time_budget, seed = map(plain_number, (target_error, points, time_budget, seed))
    check_flags(irradiance=irradiance, mechanics_error=mechanics_error)
    if continued is not None:
        require("continued", continued, Readings, "what measure returned")
    if continued is not None and (continued.seed != seed or continued.points < FIRST_POINTS or irradiance):
        raise InputError(
            f"continued (seed = {continued.seed}, {continued.points} points) is not allowed: readings with seed = "
            f"{seed} and at least {FIRST_POINTS} points are needed, and irradiance = False."
        )
    clock = Clock(time_budget)
    changes = _changes(scene, derivatives)

    # Light: without random numbers, or by random paths up to the number of points, the target or the time budget.
    with stages.record() as seconds, stages.stage("optics"):
        random = points is not None or irradiance or (time_budget is not None and target_error is None)
        prepared = _prepared(scene, target_error, points, seed, clock, mechanics_error, continued, random)
        run = Run(prepared.ready, seed, irradiance, continued)
        if prepared.errors.power is None:
            run.extend_to(prepared.settings.points, clock)
            if not is_touched(prepared.ready.scene):  # little light passes where a roof rests on a package
                run.extend_to_error(prepared.light_error, clock)
    result = _result(prepared, run, seconds, mechanics_error)
    if prepared.alternative is not None:
        exact = _result(prepared.alternative, Run(prepared.alternative.ready, seed), seconds, mechanics_error)
        if _rank(exact) <= _rank(result):
            result, prepared = exact, prepared.alternative

    # Results of the pads, and derivatives.
    with stages.record() as taken, stages.stage("mechanics"):
        measured = prepared.ready.scene
        pads = pad_results([pad.state for pad in deformed_pads(measured)], mechanics_error)
        result = replace(result, pads=pads, exceeded_limits=exceeded_limits(measured), finishes=finishes_of(measured))
    _add_seconds(result, taken)
    if changes:
        result = replace(result, derivatives=_derivatives(scene, changes, prepared, result, points is not None))

    # Remarks: notes on the scene (the chosen integrator matters for random paths only), and limits that were reached.
    by_paths = prepared.errors.power is None
    result.remarks.extend(note for note in prepared.ready.notes if by_paths or note != CHOSEN_INTEGRATOR)
    bare = target_error is None and points is None and time_budget is None and not is_touched(prepared.ready.scene)
    result.remarks.extend(_remarks(result, LIGHT_ERROR if bare else None, target_error, points))
    if time_budget is not None and target_error is None and points is None and result.points < MOST_POINTS:
        result.remarks.append(f"time budget used up after {result.points} points")
    return result, prepared.ready


def _result(prepared: PreparedFor, run: Run, seconds: dict[str, float], mechanics_error: bool) -> Readings:
    """Create the :class:`Readings` of a prepared scene: from the random paths of ``run``, or from powers already
    computed without random numbers."""
    ready, errors = prepared.ready, prepared.errors
    powers = run.powers if errors.power is None else np.tile(errors.power, (REPLICATES, 1))
    if not np.all(np.isfinite(powers)):
        raise ComputationError("readings are not finite: check the units of sizes (mm) and powers (W) in the scene.")
    replicates, taxels = powers.shape
    # Light that paths may have missed on dark taxels.
    dark_error = None
    if run.points and not powers.any(axis=0).all():
        dark_error = dark_errors(ready.scene, ready.integrator, run.points * replicates, taxels)
    facets = None
    if mechanics_error or errors.power is not None:
        facets = np.zeros(taxels) if errors.geometry.facets is None else errors.geometry.facets
    try:
        pairs = taxels_of(ready.scene)
    except InputError:  # LEDs and phototransistors cannot be paired
        responsivity = positions = None
    else:
        in_order = [np.full(pair.count, pair.sensor.responsivity(pair.led.wavelength)) for pair in pairs]
        responsivity, positions = np.concatenate(in_order), taxel_positions(pairs)
    return Readings(
        replicates=powers,
        points=run.points,
        seed=run.seed,
        seconds=seconds,
        parameters=ready.parameters,
        irradiance=run.image,
        responsivity=responsivity,
        positions=positions,
        deviation=errors.mechanics.deviation,
        dark_error=dark_error,
        facets=facets,
        mesh_size=prepared.settings.mesh_size,
        roof_errors=roof_errors(ready.scene) if mechanics_error else [],
    )


def _rank(result: Readings) -> tuple[bool, float]:
    """Sort key of readings, smaller is better: whether the total error is unknown, then the largest relative error (of
    the light alone if the error of the mechanics is unknown)."""
    budget = result.error_budget
    unknown = math.isnan(budget["total"])
    return unknown, math.hypot(budget["light"], budget["geometry"]) if unknown else budget["total"]


def _changes(scene: AnyScene, names: Sequence[str]) -> list[Rates]:
    """Rates of change of the scene's parts with respect to each of the named parameters."""
    parameters = names_of("derivatives", names)
    if not parameters:
        return []
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates  # needed for derivatives only

    scene = described(scene)
    if not isinstance(scene, Scene):
        raise InputError("derivatives need the description of a scene: pass a Scene, a path or a name.")
    return [rates(scene, name) for name in parameters]


def _derivatives(
    scene: AnyScene, changes: list[Rates], prepared: PreparedFor, readings: Readings, fixed: bool
) -> Derivatives:
    """Derivatives of the readings, computed without random numbers if possible, else by random paths. With ``fixed``,
    derivatives use as many paths as the readings.
    """
    from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
    from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

    with stages.record() as taken:
        try:
            result = derivatives_by(changes, prepared.ready.scene)
        except (NotDiffuse, NotFollowed):
            from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths

            # Rates on the mesh of the readings.
            scene, size = described(scene), prepared.settings.mesh_size
            assert isinstance(scene, Scene)  # or there were no changes
            if scene.mesh_size != size:
                changes = _changes(scene.with_mesh_size(size), [change.name for change in changes])
            points = readings.points or FIRST_POINTS
            result = derivatives_of_paths(changes, prepared.ready, readings.replicates, readings.seed, points, fixed)
    _add_seconds(readings, taken)
    return result


def _add_seconds(readings: Readings, taken: dict[str, float]) -> None:
    readings.seconds.update({stage: readings.seconds.get(stage, 0.0) + more for stage, more in taken.items()})


def _prepared(
    scene: AnyScene,
    target_error: float | None,
    points: int | None,
    seed: int,
    clock: Clock,
    mechanics_error: bool,
    continued: Readings | None,
    random: bool,
) -> PreparedFor:
    """Prepare a scene: choose its mesh and number of points, or compute its readings without random numbers. With
    ``random``, random paths are used in any case.
    """
    scene = described(scene)
    if continued is not None and isinstance(scene, Scene):
        scene = scene.with_mesh_size(continued.mesh_size)
    elif target_error is not None:
        return prepare_for(scene, target_error, seed, clock, random)
    # Without a target, the mesh stays as it is. Light without random numbers is preferred if it is accurate enough.
    ready = prepare(scene)
    alternative = None
    if not (random or continued) and (certain := without_random_numbers(ready, mechanics_error)):
        alternative = prepared_without_random_numbers(ready, scene, certain)
        if certain.light_share <= LIGHT_ERROR:
            return alternative
    # With random paths, short traces give the error due to facets, the number of points, and the mechanics error.
    geometry = FLAT
    if mechanics_error:
        tolerance = NEGLIGIBLE * (0.0 if points else target_error or LIGHT_ERROR)
        geometry = geometry_of(ready, seed, geometry_points(points or MOST_POINTS), tolerance)
    light_error = math.inf
    if points is None and (target_error is not None or clock.end == math.inf):
        light_error = target_error or LIGHT_ERROR
        points = points_for(ready, light_error, clock, geometry.pilot)
    points = points or MOST_POINTS
    mechanics = MechanicsEstimate(None, 0.0)
    if mechanics_error:
        mechanics = mechanics_of(ready, seed, deviation_points(clock, points))
    settings = Settings(points, mesh_size_of(scene))
    return PreparedFor(ready, ShapeErrors(mechanics, geometry), settings, light_error, alternative)


@in_turn
def crosstalk(
    scene: AnyScene, *, target_error: float | None = None, points: int | None = None, seed: int = 0
) -> Crosstalk:
    """Compute the power that each LED alone brings to each phototransistor.

    Parameters
    ----------
    scene : Scene or str or Path or dict or mi.Scene or Prepared
        Scene in any form that :func:`measure` takes.
    target_error : float, optional
        Relative standard error of the light that each phototransistor's power from its own LED should reach; 0.005 by
        default.
    points : int, optional
        Light paths for each LED and replicate, instead of a target; rounded up to a power of two.
    seed : int
        Whole number from 0 to 2**32 - 1.

    Returns
    -------
    Crosstalk
        Matrix of powers in W, a row for each LED and a column for each phototransistor, with errors.

    Raises
    ------
    InputError
        as :func:`measure`, and if the scene's integrator is one of Mitsuba's own, under which all LEDs are lit.
    """
    check_request(target_error, points, seed)
    target_error, points, seed = map(plain_number, (target_error, points, seed))
    ready = prepare(scene)
    if not traces_taxels(ready.integrator):
        kind = kind_of(ready.integrator)
        raise InputError(f"integrator {kind} computes no crosstalk: use taxel_tracer, taxel_path or analog_tracer.")
    if points is None:
        points = points_for(ready, target_error or LIGHT_ERROR)
    count: int = points
    pairs = taxels_of(ready.scene)
    if len(pairs) > 1:
        raise InputError(f"crosstalk needs all taxels in one photo_reflector; the scene has {len(pairs)}.")
    set_wavelength(ready.scene, [pairs[0].led])

    def traced() -> np.ndarray:
        nonlocal count
        powers, _, count = trace(ready.integrator, ready.scene, pairs[0], count, seed, REPLICATES, crosstalk=True)
        return powers

    deviation = None
    if loaded_pads(ready.scene):
        powers, changes = mechanics_deviations(ready.scene, traced)
        deviation = np.full(powers.shape[1:], np.nan) if changes is None else combined(changes.mean(axis=1))
    else:
        powers = traced()
    dark = dark_errors(ready.scene, ready.integrator, count * REPLICATES, pairs[0].count)
    return Crosstalk(powers, count, seed, np.broadcast_to(dark, powers.shape[1:]), deviation)


def _remarks(result: Readings, light_error: float | None, target_error: float | None, points: int | None) -> list[str]:
    """Remarks on missed targets, the chosen mesh, the time budget, dark taxels and rare paths."""
    notes = []
    if light_error is not None and light_error < result.relative_error < math.inf:
        notes.append(
            f"target error {light_error:g} not reached: {result.relative_error:.2g} with {result.points} points"
        )
    if target_error is not None and not result.relative_total_error <= target_error:
        reached = (
            f"light {_in_words(result.relative_error)} with {result.points} points" if result.points else "light 0"
        )
        if result.deviation is not None:
            reached += f", mechanics {_in_words(result.error_budget['mechanics'])}"
        if result.geometry_error.any():
            reached += f", geometry {result.error_budget['geometry']:.2g}"
        notes.append(f"target error {target_error:g} not reached: {reached}")
    if target_error is not None and result.mesh_size is not None:
        notes.append(f"finite elements of {result.mesh_size:.3g} mm chosen for the target error")
    if points is not None and result.points < points:
        notes.append(f"time budget used up after {result.points} of {points} points")
    dark = result.power <= 0
    if dark.any():
        missed = float(np.max(result.standard_error[dark]))
        limit = f": it may receive {missed:.1e} W (1 sigma)" if missed else ""
        limit = ": how much was missed is unknown" if math.isnan(missed) else limit
        notes.append(f"no light found on taxel {', '.join(map(str, result.taxel[dark]))}{limit}")
    rare = largest_scatter_share(result.replicates) > MOST_OF_SCATTER
    if rare.any():
        notes.append(
            f"few light paths carry much of the light on taxel {', '.join(map(str, result.taxel[rare]))}: one of "
            f"{len(result.replicates)} randomisations has most of the scatter, and the light error is uncertain"
        )
    return notes


def _in_words(error: float) -> str:
    """Text of a relative error: two digits, or ``unknown``."""
    return f"{error:.2g}" if math.isfinite(error) else "unknown"


def check_request(
    target_error: float | None,
    points: int | None,
    seed: int,
    time_budget: float | None = None,
    derivatives: Sequence[str] = (),
) -> None:
    """Check the arguments of :func:`measure`, and raise `InputError` if one is not allowed.

    Parameters
    ----------
    target_error : float or None
        Relative total error that every taxel should reach, as for :func:`measure`.
    points : int or None
        Number of light paths for each taxel and replicate, as for :func:`measure`.
    seed : int
        Seed of the random numbers, as for :func:`measure`.
    time_budget : float, optional
        Time in s after which nothing further is traced, as for :func:`measure`.
    derivatives : sequence of str
        Names of the parameters with respect to which the readings are differentiated.

    Raises
    ------
    InputError
        if a value is not allowed, if both a target and a number of points are given, or if both a time budget and
        derivatives are given.
    """
    if time_budget is not None and len(derivatives):
        raise InputError(
            "time_budget and derivatives (which sweeps over a force without a step use, too) exclude each other, as "
            "the time of derivatives cannot be limited: leave one out."
        )
    if target_error is not None and points is not None:
        raise InputError("target_error and points exclude each other: give one of them.")
    if target_error is not None and not (is_number(target_error) and 0 < target_error < 1):
        raise InputError(f"target_error = {target_error!r} is not allowed: a number between 0 and 1 is needed.")
    if points is not None:
        check_whole("points", points, 1, MOST_POINTS)
    if time_budget is not None and not (is_number(time_budget) and time_budget > 0):
        raise InputError(f"time_budget = {time_budget!r} is not allowed: a finite number of seconds above 0 is needed.")
    check_seed(seed)
