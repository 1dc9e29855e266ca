"""Optical configurations of `taxel bench light`, drawn at random. Each is read without random numbers, if possible, and
by random paths."""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes.system import peak_memory
from mitsuba_taxel.evidence.coverage.light_row import LightRow
from mitsuba_taxel.evidence.rows.kind_examples import cell_parameters, generator, other_cells
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.sensing import Readings, Scene, measure
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.targets import geometry_of

CASES, SLOPES = 120, 12
"""Number of configurations with the paper's cell shapes, and number of these whose derivatives are compared."""
OTHER_CASES = 2
"""Number of configurations with each other shape; derivatives are compared for the last of them."""
TRIES = 1000
"""Largest number of draws of a configuration."""
FIRST, MOST = 1 << 12, 1 << 18
"""Number of points per replicate of the first trace of random paths, and largest number of the last trace."""
TRACE_SECONDS = 15.0
"""Approximate CPU time of each comparison by random paths."""
NOISE = 3e-5
"""Relative standard error of random paths at which tracing ends."""
TIGHT = 0.001
"""Relative target error, for which the CPU time is measured in addition to that at the default settings."""
DERIVED = ("cell_height", "cell_size")
"""Parameters whose derivatives are compared."""


@dataclass(frozen=True)
class LightCase:
    """One optical configuration of a pad with one cell.

    Attributes
    ----------
    source : dict
        Source of the scene as a dictionary, without the files of tabulated laws.
    tables : dict[str, list[tuple[float, float]]]
        Tabulated laws of the components ``led`` and ``sensor`` of the package: rows of angle in degrees and value.
    with_slopes : bool
        Whether derivatives are compared as well.
    """

    name: str
    source: dict[str, Any]
    tables: dict[str, list[tuple[float, float]]]
    with_slopes: bool = False

    def measured(self) -> LightRow:
        """Read this configuration without random numbers and by random paths, in this process, and return the row of
        the table.
        """
        with tempfile.TemporaryDirectory() as folder:
            scene = self.scene(Path(folder))
            try:
                return self._compared(scene)
            except (ComputationError, InputError) as error:
                return LightRow(self.name, remark=str(error))

    def failed(self, end: str) -> LightRow:
        """The result of a case whose process ended without a result, for the reason ``end``."""
        return LightRow(self.name, remark=end)

    def scene(self, folder: Path) -> Scene:
        """Make the scene; its tabulated laws are written as files to a folder."""
        source = {**self.source, "package": dict(self.source["package"])}
        for component, rows in self.tables.items():
            file = folder / f"{component}.csv"
            file.write_text("\n".join(f"{angle:.6g},{value:.6g}" for angle, value in rows), encoding="utf-8")
            source["package"][component] = {**source["package"][component], "file": str(file)}
        return Scene(source)

    def _compared(self, scene: Scene) -> LightRow:
        start = time.process_time()
        default = measure(scene, mechanics_error=False)
        seconds, deterministic = time.process_time() - start, default.points == 0
        start = time.process_time()
        measure(scene, target_error=TIGHT, mechanics_error=False)
        tight = time.process_time() - start
        megabytes = peak_memory()
        truth = traced(scene)
        power, true = float(default.power[0]), float(truth.power[0])
        scale = true or power or 1.0
        stated_error, noise = (float(result.total_error[0]) / scale for result in (default, truth))
        noise = math.hypot(noise, geometry_of(prepare(scene), seed=1).share)
        slopes = self._slopes(scene, default) if self.with_slopes else (math.nan,) * 3
        return LightRow(
            case=self.name,
            random="no" if deterministic else "yes",
            power=power,
            off=(power - true) / scale,
            stated=stated_error,
            noise=noise,
            slope_off=slopes[0],
            slope_stated=slopes[1],
            slope_noise=slopes[2],
            seconds=seconds,
            tight_seconds=tight,
            megabytes=megabytes,
        )

    def _slopes(self, scene: Scene, default: Readings) -> tuple[float, float, float]:
        """Compare derivatives without random numbers with those by random paths. Returns deviation, stated error, and
        noise of the worst derivative, relative to the reading, per mm.

        The worst derivative has the largest deviation divided by the combined error. All three numbers are NaN for
        scenes whose light needs random paths.
        """
        from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
        from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths
        from mitsuba_taxel.sensing.derivatives.scene_rates import rates
        from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
        from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

        changes, ready = [rates(scene, name) for name in DERIVED], prepare(scene)
        try:
            default_slopes = derivatives_by(changes, ready.scene)
        except (NotDiffuse, NotFollowed):
            return (math.nan,) * 3
        points = FIRST
        truth = derivatives_of_paths(changes, ready, measure(ready, points=points, seed=7).replicates, 7, points, True)
        deviation = (default_slopes.values - truth.values)[0] / default.power[0]
        error, noise = (slopes.standard_errors[0] / default.power[0] for slopes in (default_slopes, truth))
        worst = np.argmax(np.abs(deviation) / np.hypot(error, noise))
        return float(deviation[worst]), float(error[worst]), float(noise[worst])


def traced(scene: Scene) -> Readings:
    """Reference values: readings by random paths, with as many paths as are needed for low noise and as the time
    allows.
    """
    start, points = time.process_time(), FIRST
    readings = measure(scene, points=points, seed=1, mechanics_error=False)
    while True:
        seconds = max(time.process_time() - start, 0.05)
        noise = readings.relative_error
        if not NOISE < noise or points >= MOST or 5 * seconds > TRACE_SECONDS:
            return readings
        points *= 4
        start = time.process_time()
        readings = measure(scene, points=points, seed=1, mechanics_error=False)


def light_cases(seed: int = 52) -> list[LightCase]:
    """Draw all configurations of the table at random: those with the paper's cell shapes, then some with each other
    registered shape.

    Parameters
    ----------
    seed : int
        Seed of the draw. Other shapes have separate random numbers, so that a newly registered shape does not change
        the other configurations.

    Returns
    -------
    list of LightCase
        Cases in the order of the table.
    """
    random = np.random.default_rng(seed)
    cases = []
    for number in range(1, CASES + 1):
        cell = CELL_SHAPES[(number - 1) % len(CELL_SHAPES)]
        cases.append(drawn_case(random, f"{number:03d} {cell}", cell, with_slopes=number % (CASES // SLOPES) == 0))
    for cell in other_cells():
        random = generator(seed, cell)
        for number in range(1, OTHER_CASES + 1):
            cases.append(drawn_case(random, f"{cell} {number}:", cell, with_slopes=number == OTHER_CASES))
    return cases


def drawn_case(random: np.random.Generator, label: str, cell: str, with_slopes: bool = False) -> LightCase:
    """Draw a random configuration with a given cell shape; the draw is repeated until its components fit together.

    Parameters
    ----------
    random : np.random.Generator
        Generator of the random numbers.
    label : str
        First word of the configuration's name.
    cell : str
        Name of the cell shape.
    with_slopes : bool
        Whether derivatives are compared as well.

    Returns
    -------
    LightCase
        A pad with one cell above one package.
    """
    for _ in range(TRIES):
        case = _draw(random, label, cell, with_slopes)
        if case is not None:
            return case
    raise AssertionError(f"no drawn configuration of {cell} cells fits")


def _draw(random: np.random.Generator, label: str, cell: str, with_slopes: bool) -> LightCase | None:
    """Draw a random configuration; None if its components do not fit together."""
    tables: dict[str, list[tuple[float, float]]] = {}
    led, led_words = _led(random, tables)
    sensor, sensor_words = _sensor(random, tables)
    size = round(random.uniform(2.0, 3.6), 2)
    pad: dict[str, Any] = {"cell": cell, "rows": 1, "columns": 1, "cell_size": size, "pitch": round(size + 1.0, 2)}
    pad |= cell_parameters(cell)
    if cell != "hemispheric" and random.random() < 0.5:
        pad["cell_height"] = round(random.uniform(1.2, 2.2), 2)
    roof, roof_words = _wall(random)
    side, side_words = _wall(random) if random.random() < 0.5 else (None, "absorbing")
    loaded = random.random() < 0.25
    if loaded:
        pad |= {"force": [0.0, 0.0, -round(random.uniform(0.2, 0.8), 2)], "mesh_size": 1.25}
    spacing = round(random.uniform(0.4, 1.0), 2)
    half_led, half_sensor = led["size"] / 2, sensor["width"] / 2
    if half_led + half_sensor > spacing - 0.02 or spacing / 2 + max(half_led, half_sensor) > 0.71:
        return None
    try:
        Pad(**{name: value for name, value in pad.items() if name not in ("force", "mesh_size")})
    except InputError:
        return None
    walls = {"type": "region", "roof": roof, **({} if side is None else {"side": side})}
    package = {"type": "photo_reflector", "spacing": spacing, "led": led, "sensor": sensor}
    source = {"type": "scene", "pad": {"type": "deformable_pad", **pad, "bsdf": walls}, "package": package}
    load = f", {pad['force'][2]:g} N" if loaded else ""
    name = f"{label} {size:g} mm{load}, roof {roof_words}, sides {side_words}; LED {led_words}; response {sensor_words}"
    return LightCase(name, source, tables, with_slopes)


def _led(random: np.random.Generator, tables: dict) -> tuple[dict[str, Any], str]:
    size = round(10 ** random.uniform(-2, -0.4), 3)
    led: dict[str, Any] = {"type": "annular_led", "size": size, "shape": str(random.choice(["square", "circular"]))}
    led["hole"] = round(0.4 * size, 4) if random.random() < 0.5 else 0.0
    law = str(random.choice(["uniform_solid_angle", "uniform_polar_angle", "lambertian", "cosine_power", "tabulated"],
                            p=[0.3, 0.2, 0.1, 0.2, 0.2]))  # fmt: skip
    led["law"], name = law, f"{size:g} mm, {law}"
    if "angle" in law:
        led["cone_angle"] = float(f"{10 ** random.uniform(math.log10(0.05), math.log10(90)):.3g}")
        name += f" {led['cone_angle']:g}"
    elif law == "cosine_power":
        led["exponent"] = float(f"{10 ** random.uniform(-1, 6):.3g}") if random.random() < 0.9 else 0.0
        name += f" {led['exponent']:g}"
    elif law == "tabulated":
        end = float(f"{10 ** random.uniform(0.3, math.log10(90)):.3g}")
        tables["led"] = _table(random, end, end_value=0.0 if random.random() < 0.5 else 0.3)
        name += f" to {end:g}"
    return led, name


def _sensor(random: np.random.Generator, tables: dict) -> tuple[dict[str, Any], str]:
    width, depth = (round(10 ** random.uniform(-1.7, -0.25), 3) for _ in range(2))
    response = str(random.choice(["ideal", "cosine_power", "tabulated"], p=[0.6, 0.25, 0.15]))
    sensor: dict[str, Any] = {"type": "phototransistor", "width": width, "depth": depth, "response": response}
    name = f"{width:g} x {depth:g} mm, {response}"
    if response == "cosine_power":
        sensor["exponent"] = float(f"{10 ** random.uniform(0, 4):.3g}")
        name += f" {sensor['exponent']:g}"
    elif response == "tabulated":
        end = float(f"{random.uniform(20, 90):.3g}")
        tables["sensor"] = _table(random, end, end_value=0.0)
        name += f" to {end:g}"
    return sensor, name


def _table(random: np.random.Generator, end: float, end_value: float) -> list[tuple[float, float]]:
    """Draw a random tabulated law: rows of angle in degrees and value. It falls in random steps from 1 to ``end_value``
    at the angle ``end``."""
    count = int(random.integers(2, 8))
    angles = end * np.concatenate([[0], np.sort(random.uniform(0.1, 0.9, count - 2)), [1]])
    falls = random.uniform(0.2, 1, count - 1)
    values = 1 - (1 - end_value) * np.concatenate([[0], np.cumsum(falls) / falls.sum()])
    return [(float(angle), max(float(value), 0.0)) for angle, value in zip(angles, values, strict=True)]


def _wall(random: np.random.Generator) -> tuple[dict[str, Any], str]:
    reflectance = 1.0 if random.random() < 0.2 else round(random.uniform(0.3, 0.98), 2)
    scattering = str(random.choice(["isotropic", "lambertian", "mixed"]))
    wall: dict[str, Any] = {"type": "wall", "scattering": scattering, "reflectance": reflectance}
    if scattering == "mixed":
        even = round(random.uniform(0.2, 0.8), 2)
        wall |= {"isotropic": even, "lambertian": round(1 - even, 2)}
    return wall, f"{scattering} {reflectance:g}"
