"""Error against computing time of readings, derivatives and touch, in a few settings.

Light without random numbers is computed with several patch sizes, random paths with several numbers of paths, and touch
with several depths. Derivatives are computed with both kinds of light.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.caches import clear_caches
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.accuracy.mechanics import from_nothing
from mitsuba_taxel.evidence.accuracy.methods import Estimate, Estimator, of_readings
from mitsuba_taxel.evidence.accuracy.optics import SampleRuns, reference, rung_point, rungs
from mitsuba_taxel.evidence.accuracy.plot import plot_accuracy
from mitsuba_taxel.evidence.accuracy.tables import write_csv
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, TruthEstimate, WorkPoint, now, relative_rms
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import IndenterDisplacement
from mitsuba_taxel.mechanics.surface.finish import LayerSteps
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.sensing import PadSensor, Scene, measure
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light
from mitsuba_taxel.sensing.diffuse.diffuse_cells import kept_cell
from mitsuba_taxel.sensing.reading.runs import MOST_POINTS, REPLICATES, Prepared, prepare
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.photo_reflector import PhotoReflector
from mitsuba_taxel.specification.wall import Wall
from mitsuba_taxel.studies.plan.files import make_folder

PATCHES = (2.0, 1.4, 1.0, 0.7)
"""Patch sizes, relative to the default."""
BALL_RADIUS, DEPTHS, FINE = 2.0, (0.1, 0.2, 0.4), 0.7
"""Radius of the ball, its depths, and mesh size of the reference, in mm."""
FORCE = -1.0
"""Force in N at which derivatives are computed."""
SLOPE_POINTS, SLOPE_SEEDS = (256, 1024, 4096), 2
"""Numbers of points per replicate of derivatives by random paths, and number of runs with each."""
FACETS_POINTS = 4096
"""Number of points per replicate of the reading that gives the error due to triangles."""
LONGER, LONGER_SLOPES = 32, 8
"""Number of samples in a run of the reference, relative to the longest run that is compared with it: for readings, and
for slopes."""
LONGEST = MOST_POINTS * REPLICATES // LONGER
WITHOUT, PATHS = "without random numbers", "random paths"

Starting = Callable[[str], None]


def settings() -> dict[str, Callable[[float, Starting], list[ErrorCurve]]]:
    """For each setting, by name, a function that measures its curves; its argument is the CPU time in s for each curve
    of random paths."""
    grey, sides = Wall("lambertian", 0.9), Wall("lambertian", 0.5)
    narrow = PhotoReflector(led=AnnularLed(cone_angle=1.0))
    dome, box = Pad("hemispheric", 1, 1), Pad("parallelepiped", 1, 1)
    plate = partial(Scene.from_file, "plate.xml", scattering="lambertian")
    printed = PadSensor(Pad("cylindrical", 1, 1), roof=grey, side=sides, finish=LayerSteps(0.2))
    return {
        "plate": partial(_light, plate, False),
        "box": partial(_light, PadSensor(box, roof=grey, side=sides).scene, True),
        "dome": partial(_light, PadSensor(dome, roof=Wall("isotropic", 0.9)).scene, True),
        "narrow beam": partial(_light, PadSensor(box, roof=grey, photo_reflector=narrow).scene, True),
        "mirror dome": partial(_light, PadSensor(dome, roof=Wall("mirror", 0.9)).scene, False),
        "rough mirror dome": partial(
            _light, PadSensor(dome, roof=Wall("rough_mirror", 0.9, rms_slope=2.0)).scene, False
        ),
        "printed steps": partial(_light, printed.scene, False),
        "slope of a dome": partial(
            _slope, PadSensor(dome, force=(0, 0, FORCE), roof=Wall("isotropic", 0.9)).scene, True
        ),
        "slope of a mirror dome": partial(
            _slope, PadSensor(dome, force=(0, 0, FORCE), roof=Wall("mirror", 0.9)).scene, False
        ),
        "ball by depth": _touch,
    }


def settings_accuracy(folder: Path, seconds: float, starting: Starting = lambda step: None) -> list[ErrorCurve]:
    """Measure all settings, and write ``accuracy.csv``, ``accuracy.png`` and ``accuracy.svg`` to a folder.

    Parameters
    ----------
    folder : Path
        Output folder, which is created if it does not exist.
    seconds : float
        CPU time of each curve of random paths, in s; derivatives take about 20 s in addition.
    starting : Callable[[str], None]
        Called with the name of each step.

    Raises
    ------
    InputError
        if the time is not allowed, or the folder cannot be written to.
    """
    if not 0 < seconds < math.inf:
        raise InputError(f"seconds = {seconds} is not allowed: a finite number above 0 is needed.")
    make_folder(folder)
    curves: list[ErrorCurve] = []
    for name, measured in settings().items():
        starting(name)
        curves += [replace(curve, part=name) for curve in measured(seconds, starting)]
        write_csv(curves, folder / "accuracy.csv")
    titles = {name: name for name in settings()}
    plot_accuracy(curves, "Methods by which sensors are read", folder, titles, labelled=tuple(titles))
    return curves


def _light(scene: Callable[[], Scene], is_diffuse: bool, seconds: float, starting: Starting) -> list[ErrorCurve]:
    """Measure the curves of readings: by random paths, and without random numbers if all walls are diffuse.

    The reference is a reading by many more random paths.
    """
    ready = prepare(scene())
    estimate = of_readings(ready)
    path_rungs, truth = _over_paths(estimate, seconds, starting)
    # Random paths hit triangles instead of the curved walls.
    facets = measure(ready, points=FACETS_POINTS).geometry_error
    truth = replace(truth, error=np.hypot(truth.error, facets))
    curves = [ErrorCurve("", PATHS, [rung_point(rung, truth) for rung in path_rungs], launched=True)]
    if is_diffuse:

        def by_patches(size: float) -> Estimate | None:
            light = deterministic_light(ready.scene, False, size)
            return None if light is None else Estimate(light.power, light.error)

        curves.append(_over_patches(by_patches, ready, truth, starting))
    return curves


def _slope(scene: Callable[[], Scene], is_diffuse: bool, seconds: float, starting: Starting) -> list[ErrorCurve]:
    """Measure the curves of derivatives with respect to the force along z.

    All derivatives use the same mechanics, so that the errors are those of the light. The curves show magnitudes,
    because derivatives may be negative.
    """
    scene_data = scene()
    ready, change = prepare(scene_data), rates(scene_data, "fz")
    powers = measure(ready, points=1024, mechanics_error=False).replicates

    def by_paths(points: int, seed: int) -> Estimate:
        derivatives = derivatives_of_paths([change], ready, powers, seed, points, True)
        return Estimate(np.abs(derivatives.values[:, 0]), derivatives.standard_errors[:, 0])

    starting("reference")
    reference_runs = [by_paths(LONGER_SLOPES * SLOPE_POINTS[-1], seed) for seed in range(SLOPE_SEEDS)]
    error = np.linalg.norm([run.stated for run in reference_runs], axis=0) / SLOPE_SEEDS
    truth = TruthEstimate(np.mean([run.power for run in reference_runs], axis=0), error, PATHS)
    points = []
    for count in SLOPE_POINTS:
        starting(f"{PATHS}, {count} points")
        start = now()
        runs = [by_paths(count, SLOPE_SEEDS + seed) for seed in range(SLOPE_SEEDS)]
        power, error = (np.array(column) for column in zip(*runs, strict=True))
        points.append(_point(f"{count} points", power, error, (now() - start) / SLOPE_SEEDS, truth))
    curves = [ErrorCurve("", PATHS, points)]
    if is_diffuse:

        def by_patches(size: float) -> Estimate:
            derivatives = derivatives_by([change], ready.scene, patch_size=size)
            return Estimate(np.abs(derivatives.values[:, 0]), derivatives.standard_errors[:, 0])

        curves.append(_over_patches(by_patches, ready, truth, starting))
    return curves


def _over_paths(estimate: Estimator, seconds: float, starting: Starting) -> tuple[list[SampleRuns], TruthEstimate]:
    """Run a method with increasing numbers of samples, and compute reference values from a few long runs with other
    random numbers.

    A few long runs have a smaller error than many short runs.
    """
    starting(PATHS)
    path_rungs = list(rungs(estimate, seconds, LONGEST))
    starting("reference")
    return path_rungs, reference(PATHS, estimate, LONGER * path_rungs[-1].samples, seconds)


def _over_patches(
    estimate: Callable[[float], Estimate | None], ready: Prepared, truth: TruthEstimate, starting: Starting
) -> ErrorCurve:
    """Measure the curve of light without random numbers for several patch sizes; only compiled code is cached between
    sizes."""
    default_size = deformed_pads(ready.scene)[0].pad.default_mesh_size
    points, remarks = [], []
    estimate(PATCHES[0] * default_size)  # compiles
    for fraction in PATCHES:
        size = fraction * default_size
        starting(f"{WITHOUT}, patches of {size:.2g} mm")
        clear_caches(kept_cell)
        start = now()
        try:
            result = estimate(size)
        except ComputationError as error:
            remarks.append(f"{size:.2g} mm: {error}")
            continue
        if result is None:
            remarks.append(f"patches of {size:.2g} mm: too many patches, or too much hidden light")
        else:
            points.append(_point(f"{size:.2g} mm", result.power, result.stated, now() - start, truth))
    return ErrorCurve("", WITHOUT, points, remark="; ".join(remarks))


def _touch(seconds: float, starting: Starting) -> list[ErrorCurve]:
    """Measure the curve of readings of a cell under a ball, for several depths, with default settings; the reference
    has elements of half the size."""
    points = []
    for depth in DEPTHS:
        starting(f"depth {depth:g} mm")
        load = IndenterDisplacement(Indenter("sphere", radius=BALL_RADIUS))
        pad, roof = Pad("cylindrical", 1, 1), Wall("lambertian", 0.9)
        scene = PadSensor(pad, force=(0, 0, -depth), load=load, roof=roof).scene()
        with from_nothing():
            clear_caches(kept_cell)
            start = now()
            readings = measure(scene)
            elapsed = now() - start
            fine_readings = measure(scene.with_mesh_size(FINE))
        truth = TruthEstimate(fine_readings.power, fine_readings.total_error, f"elements of {FINE:g} mm")
        points.append(_point(f"{depth:g} mm", readings.power, readings.total_error, elapsed, truth))
    return [ErrorCurve("", "default elements, by depth", points)]


def _point(
    setting: str, power: np.ndarray, stated_error: np.ndarray, seconds: float, truth: TruthEstimate
) -> WorkPoint:
    return WorkPoint(
        setting=setting,
        seconds=seconds,
        error=relative_rms(power - truth.power, truth.power),
        stated=relative_rms(stated_error, truth.power),
        floor=truth.floor,
        reference=truth.name,
        runs=len(np.atleast_2d(power)),
        readings=power.size,
    )
