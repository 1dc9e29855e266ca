"""Optical configurations drawn at random, each read without random numbers, if it can be, and by random paths."""

from __future__ import annotations

import math
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.coverage.light_row import LightRow
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.sensing import Readings, Scene, measure
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.targets import geometry_of

CASES, SLOPES = 120, 12
"""Number of configurations, and of those whose derivatives are compared."""
FIRST, MOST = 1 << 12, 1 << 18
"""Points per replicate of the first trace of random paths, and of the last at most."""
TRACE_SECONDS = 15.0
"""Of processors' time for each comparison by random paths, about."""
NOISE = 3e-5
"""Relative standard error of random paths below which no more are traced."""
TIGHT = 0.001
"""Relative target error whose time is measured beside the default's."""
DERIVED = ("cell_height", "cell_size")
"""Parameters of the derivatives."""


@dataclass(frozen=True)
class LightCase:
    """One row of the table.

    Attributes
    ----------
    source : dict
        Of the scene; files of its tables are named ``led`` and ``sensor``.
    tables : dict[str, list[tuple[float, float]]]
        Their rows: angle in degrees, and value.
    with_slopes : bool
        Whether derivatives are compared as well.
    """

    name: str
    source: dict[str, Any]
    tables: dict[str, list[tuple[float, float]]]
    with_slopes: bool = False

    def measured(self) -> LightRow:
        """The row, measured in this process."""
        with tempfile.TemporaryDirectory() as folder:
            scene = self.scene(Path(folder))
            try:
                return self._compared(scene)
            except (ComputationError, InputError) as error:
                return LightRow(self.name, remark=str(error))

    def failed(self, end: str) -> LightRow:
        """The row of a process that returned none."""
        return LightRow(self.name, remark=end)

    def scene(self, folder: Path) -> Scene:
        """The scene, with its tables as files in a folder."""
        source = {**self.source, "package": dict(self.source["package"])}
        for part, rows in self.tables.items():
            file = folder / f"{part}.csv"
            file.write_text("\n".join(f"{angle:.6g},{value:.6g}" for angle, value in rows), encoding="utf-8")
            source["package"][part] = {**source["package"][part], "file": str(file)}
        return Scene(source)

    def _compared(self, scene: Scene) -> LightRow:
        began = time.process_time()
        default = measure(scene, mechanics_error=False)
        seconds, quiet = time.process_time() - began, default.points == 0
        began = time.process_time()
        measure(scene, target_error=TIGHT, mechanics_error=False)
        tight = time.process_time() - began
        megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        truth = traced(scene)
        power, true = float(default.power[0]), float(truth.power[0])
        scale = true or power or 1.0
        stated, noise = (float(each.total_error[0]) / scale for each in (default, truth))
        noise = math.hypot(noise, geometry_of(prepare(scene), seed=1).share)
        slopes = self._slopes(scene, default) if self.with_slopes else (math.nan,) * 3
        return LightRow(
            self.name,
            "no" if quiet else "yes",
            power,
            (power - true) / scale,
            stated,
            noise,
            *slopes,
            seconds,
            tight,
            megabytes,
        )

    def _slopes(self, scene: Scene, default: Readings) -> tuple[float, float, float]:
        """The derivative that is furthest off, relative to the reading per mm: deviation, stated error, and noise."""
        from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
        from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths
        from mitsuba_taxel.sensing.derivatives.scene_rates import rates
        from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
        from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

        changes, ready = [rates(scene, name) for name in DERIVED], prepare(scene)
        try:
            found = derivatives_by(changes, ready.scene)
        except (NotDiffuse, NotFollowed):
            return (math.nan,) * 3
        points = FIRST
        truth = derivatives_of_paths(changes, ready, measure(ready, points=points, seed=7).replicates, 7, points, True)
        off = (found.values - truth.values)[0] / default.power[0]
        stated, noise = (each.standard_errors[0] / default.power[0] for each in (found, truth))
        worst = np.argmax(np.abs(off) / np.hypot(stated, noise))
        return float(off[worst]), float(stated[worst]), float(noise[worst])


def traced(scene: Scene) -> Readings:
    """Readings by random paths, as many as the noise asks for and the time allows."""
    began, points = time.process_time(), FIRST
    readings = measure(scene, points=points, seed=1, mechanics_error=False)
    while True:
        taken = max(time.process_time() - began, 0.05)
        noise = readings.relative_error
        if not NOISE < noise or points >= MOST or 5 * taken > TRACE_SECONDS:
            return readings
        points *= 4
        began = time.process_time()
        readings = measure(scene, points=points, seed=1, mechanics_error=False)


def light_cases(seed: int = 52) -> list[LightCase]:
    """The rows of the table, in its order; the same for a seed."""
    random = np.random.default_rng(seed)
    chosen: list[LightCase] = []
    while len(chosen) < CASES:
        drawn = _drawn(random, len(chosen) + 1)
        if drawn is not None:
            chosen.append(drawn)
    return chosen


def _drawn(random: np.random.Generator, number: int) -> LightCase | None:
    """A configuration, None if its parts do not fit."""
    tables: dict[str, list[tuple[float, float]]] = {}
    led, of_led = _led(random, tables)
    sensor, of_sensor = _sensor(random, tables)
    cell = CELL_SHAPES[(number - 1) % len(CELL_SHAPES)]
    size = round(random.uniform(2.0, 3.6), 2)
    pad: dict[str, Any] = {"cell": cell, "rows": 1, "columns": 1, "cell_size": size, "pitch": round(size + 1.0, 2)}
    if cell != "hemispheric" and random.random() < 0.5:
        pad["cell_height"] = round(random.uniform(1.2, 2.2), 2)
    roof, of_roof = _wall(random)
    side, of_side = _wall(random) if random.random() < 0.5 else (None, "absorbing")
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
    name = f"{number:03d} {cell} {size:g} mm{load}, roof {of_roof}, sides {of_side}; LED {of_led}; response {of_sensor}"
    return LightCase(name, source, tables, with_slopes=number % (CASES // SLOPES) == 0)


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
    """Rows of a law that falls from 1 to its value at its last angle, in degrees, by random steps."""
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
