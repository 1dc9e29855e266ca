"""Computing time of typical readings, and the number of rays per second of the tracer relative to that of ray
intersections alone."""

from __future__ import annotations

import gc
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import xarray as xr

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.base.caches import clear_caches
from mitsuba_taxel.evidence.accuracy.ramp import ROWS, ramp
from mitsuba_taxel.evidence.peers.cases import CASES
from mitsuba_taxel.kernels.paths.wavefronts import trace
from mitsuba_taxel.pads import CELL_SHAPES, Pad
from mitsuba_taxel.sensing.diffuse.diffuse_cells import kept_cell
from mitsuba_taxel.sensing.reading.runs import MOST_POINTS, REPLICATES
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.surrogates import export

RAYS = 1 << 22


def speed(target_error: float) -> Iterator[str]:
    """Measure the computing times of typical readings, and yield a line of text for each.

    Parameters
    ----------
    target_error : float
        Target error of the readings: relative error of the worst of nine taxels.
    """
    for cell in CELL_SHAPES:
        points, error, seconds = nine_taxels(cell, target_error)
        yield f"{cell}: nine taxels to {error:.3%} in {seconds:.2f} s, {points} points x {REPLICATES}"
        error, seconds = without_random_numbers(cell)
        yield f"{cell}: nine taxels without random numbers, to {error:.3%} in {seconds:.2f} s"
        alone, together = with_slope(cell)
        yield f"{cell}: a solved pad at -10 N loaded and read in {alone:.2f} s, with slopes by fz in {together:.2f} s"
        times = ramp(Pad(cell=cell))
        yield (
            f"{cell}: {ROWS} rows of a viscoelastic pad in {times.viscoelastic:.2f} CPU s, of an elastic one in "
            f"{times.elastic:.2f}, each solved in {times.each:.2f}"
        )
    yield f"taxel render plate.xml, from process start to exit: {first_answer():.2f} s"
    yield f"plate.xml, loaded, a reading of 16 points x {REPLICATES}: {1e3 * small_reading():.2f} ms of CPU time"
    yield f"a reading of nine taxels from an exported model of two forces, one core: {1e6 * exported_model():.1f} us"
    for name in ("plate-1.05", "pad-lambertian", "pad-lambertian-10"):
        gc.collect()
        traced, raw = ray_rates(CASES[name].load("taxel_tracer"))
        yield f"{name}: {traced:.3g} rays/s traced, {raw:.3g} rays/s intersected alone: {traced / raw:.0%}"


def nine_taxels(cell: str, target_error: float) -> tuple[int, float, float]:
    """Measure the time of a reading of the nine taxels of `pad.xml` to a target error. The time of loading the scene is
    excluded.

    Parameters
    ----------
    cell : str
        Shape of the cells.
    target_error : float
        Relative error of the worst taxel.

    Returns
    -------
    points : int
        Smallest number of points, a power of two, that reaches the target error.
    error : float
        The relative error that is reached.
    seconds : float
        Wall time of the reading.
    """
    gc.collect()  # a live scene adds its plugins to the kernels of every other
    scene = Scene.from_file("pad.xml", cell=cell).load()
    points = 256
    while (error := measure(scene, points=points).relative_error) > target_error and points < MOST_POINTS:
        points *= 2
    return points, error, _seconds(lambda: measure(scene, points=points))


def without_random_numbers(cell: str) -> tuple[float, float]:
    """Read `pad.xml` without random numbers. Returns the relative error of the light, and the wall time in s."""
    scene = Scene.from_file("pad.xml", cell=cell).load()
    return measure(scene).error_budget["geometry"], _seconds(partial(_solved, scene))


def with_slope(cell: str) -> tuple[float, float]:
    """Measure the wall time in s of a reading at -10 N: without derivatives, and with derivatives with respect to the
    force. The solution of the mechanics is cached.
    """
    scene = Scene.from_file("pad.xml", cell=cell, fz=-10)
    measure(scene)  # solves
    return _seconds(partial(_solved, scene)), _seconds(partial(_solved, scene, derivatives=["fz"]))


def _solved(scene: Any, **arguments: Any) -> None:
    """Read a scene without cached solutions of the light."""
    clear_caches(kept_cell)
    measure(scene, **arguments)


def first_answer() -> float:
    """Measure the wall time in s of the command ``taxel render plate.xml``, after a run that fills the kernel cache."""
    command = [sys.executable, "-c", "from taxel_cli import main; main()", "render", "plate.xml"]

    def run() -> None:
        subprocess.run(command, check=True, capture_output=True)

    run()
    return _seconds(run)


def small_reading() -> float:
    """Measure the minimum CPU time in s of a reading with few points, of a scene that was read before."""
    scene, shortest = Scene.from_file("plate.xml").load(), np.inf
    for seed in range(200):
        start = time.process_time()
        measure(scene, points=16, seed=seed)
        shortest = min(shortest, time.process_time() - start)
    return shortest


def exported_model() -> float:
    """Measure the minimum time in s of a reading by an exported model in onnxruntime: nine taxels, as polynomials in
    two forces up to degree 5."""
    import onnxruntime

    fx, fz = np.meshgrid(np.linspace(-2, 2, 9), np.linspace(0, -10, 6), indexing="ij")
    power = 4e-3 * np.exp((0.1 + 0.05 * np.arange(9)) * (fx - fz)[..., None] / 5)
    coords = {"fx": fx[:, 0], "fz": fz[0], "taxel": range(1, 10)}
    attributes = dict.fromkeys(("scene", "parameters", "seed", "points", "versions"), "")
    study = xr.Dataset({"power": (("fx", "fz", "taxel"), power)}, coords, {"curve": "fz", **attributes})
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    with TemporaryDirectory() as folder:
        export(study, file := Path(folder) / "model.onnx")
        session = onnxruntime.InferenceSession(file, options)
    inputs, shortest = {"inputs": np.array([[0.3, -4.0]])}, np.inf
    for _ in range(10_000):
        start = time.perf_counter()
        session.run(None, inputs)
        shortest = min(shortest, time.perf_counter() - start)
    return shortest


def ray_rates(scene: Any) -> tuple[float, float]:
    """Measure the number of rays per second (intersections and shadow rays) of `taxel_tracer`, and of ``ray_intersect``
    on random rays.

    The random rays start at uniformly distributed points of the scene's bounding box, in uniformly distributed
    directions.
    """
    # Count the rays of a reading, and time it.
    (pair,) = taxels_of(scene)
    points = RAYS // (REPLICATES * pair.count * 8)
    counting = _CountingScene(scene)
    run = partial(trace, scene.integrator(), pair=pair, points=points, seed=0, replicates=REPLICATES)
    run(scene=scene)  # computes the guide, whose rays do not count
    run(scene=counting)
    traced = counting.rays / _seconds(lambda: run(scene=scene))

    # Time intersections of random rays.
    rng = np.random.default_rng(0)
    box = scene.bbox()
    lowest, highest = np.array(box.min), np.array(box.max)
    positions, directions = lowest + rng.random((RAYS, 3)) * (highest - lowest), rng.standard_normal((RAYS, 3))
    origin, direction = (
        mi.Vector3f(*(mi.Float(in_packets(component)) for component in array.T)) for array in (positions, directions)
    )
    origin, direction = mi.Point3f(origin), dr.normalize(direction)
    ray = mi.Ray3f(origin, direction)
    dr.eval(ray)

    def intersect() -> None:
        dr.eval(scene.ray_intersect(ray).t)
        dr.sync_thread()

    intersect()
    return traced, RAYS / _seconds(intersect)


class _CountingScene:
    """A scene that counts its ray queries, also inside recorded loops."""

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self._count = dr.zeros(mi.UInt32, 1)

    @property
    def rays(self) -> int:
        return int(self._count[0])

    def ray_intersect(self, ray: Any, active: Any = True) -> Any:
        dr.scatter_add(self._count, 1, 0, mi.Bool(active) & dr.isfinite(ray.o.x))  # as wide as the ray
        return self._scene.ray_intersect(ray, active)

    def ray_test(self, ray: Any, active: Any) -> Any:
        dr.scatter_add(self._count, 1, 0, active)
        return self._scene.ray_test(ray, active)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._scene, name)


def _seconds(run: Callable[[], object]) -> float:
    """Median wall time in s of five runs."""
    times = []
    for _ in range(5):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return statistics.median(times)
