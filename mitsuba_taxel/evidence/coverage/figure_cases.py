"""Scenes of `taxel bench figures`, drawn at random. Their figures of merit (slopes, nonlinearity, hysteresis) at three
target errors are compared with reference values from finer elements."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.polynomial import Chebyshev

from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise import characteristics, simulated_experiments
from mitsuba_taxel.evidence.coverage.figure_row import FIGURES, TARGETS, FigureRow
from mitsuba_taxel.mechanics import MooneyRivlin, NeoHookean, Viscoelastic
from mitsuba_taxel.mechanics.errors.roof_error import size_ratio
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.sensing import PadSensor
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.photo_reflector import PhotoReflector
from mitsuba_taxel.specification.wall import Wall
from mitsuba_taxel.studies import sweep
from mitsuba_taxel.studies.plan.batch import make_batch
from mitsuba_taxel.studies.run.pool import open_pool
from mitsuba_taxel.studies.run.study import run_batch

SEED, CASES = 53, 40
TRIES = 100
LOADS = 8
OTHER_KINDS = {4: "tangential force", 7: "random paths", 9: "viscoelastic"}
"""Kinds of scenes, by the last digit of their number; all other scenes have a normal force."""
STRAINS = (0.008, 0.04)
"""Range of the largest pressure, relative to Young's modulus."""
STEP = math.sqrt(2)
"""Ratio of the two element sizes from which reference values are extrapolated."""
LARGER, FACTOR = (5, 6, 11, 12), 4
"""Numbers of scenes, one for each cell shape, that are repeated with larger loads; and factor of the loads."""
FINE, FINE_RIM = 0.6, 0.15
"""Largest size in mm of the finest elements of the reference, in general and in spherical cells with an isotropic roof.
Such a roof bends into the cell along its rim; points in a strip as wide as an element lie below each other's horizons.
Readings therefore converge with a power of the element size on much smaller elements only. The nonlinearity of scene 03
is 0.3104, 0.2487, 0.2422, 0.2515, 0.2625 and 0.2700 % on elements of 0.6, 0.424, 0.3, 0.212, 0.15 and 0.106 mm."""
POINTS = 1 << 14
"""Number of random paths of the reference for each taxel and replicate, if the light needs them."""
OTHER_SEED = 7
"""Seed of these paths; the seed of the sweeps is 0."""


@dataclass(frozen=True)
class FigureCase:
    """A scene, and the loads of its sweep.

    Attributes
    ----------
    name : str
        Description of the scene: the label of its row in the table of the page.
    sensor : PadSensor
        The sensor of the scene.
    vary, together : dict[str, list of float]
        Loads of the sweep, as the arguments of `sweep` with these names.
    """

    name: str
    sensor: PadSensor
    vary: Mapping[str, list[float]]
    together: Mapping[str, list[float]]

    def measured(self) -> Any:
        """Compute the figures of merit of this scene and their reference values in this process, and return the result.
        """
        start = time.process_time()
        numbers: dict[str, float] = {}
        try:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "scene.xml"
                self.sensor.scene().write_xml(file)
                studies = {}
                for target, error in TARGETS.items():
                    study = studies[target] = sweep(file, self.vary, together=self.together, target_error=error)
                    for figure, (value, error) in _figures(study).items():
                        numbers |= {f"{figure}_{target}_value": value, f"{figure}_{target}_error": error}
                seconds = time.process_time() - start
                size = study.attrs.get("mesh_size") or self.sensor.pad.default_mesh_size
                fine = min(size / STEP, self.largest_fine)
                true_numbers, limit = self._truth(file, fine, study)
                numbers |= {**true_numbers, **path_of_error(studies["default"], limit)}
        except (ComputationError, InputError) as error:
            return FigureRow(self.name, str(error))
        return FigureRow(self.name, "", seconds, time.process_time() - start - seconds, fine, **numbers)

    @property
    def largest_fine(self) -> float:
        """Largest size in mm that the finest elements of the reference values may have."""
        has_rim = self.sensor.pad.cell == "spherical" and self.sensor.roof.scattering == "isotropic"
        return FINE_RIM if has_rim else FINE

    def failed(self, end: str) -> Any:
        """The result of a case whose process ended without a result, for the reason ``end``."""
        return FigureRow(self.name, end)

    def _truth(self, file: Path, fine: float, study: xr.Dataset) -> tuple[dict[str, float], xr.DataArray]:
        """Compute reference values: the figures of merit in the limit of small elements, their change by the
        extrapolation from elements of ``fine`` mm, and the readings in this limit."""
        random = POINTS if study.attrs["points"] else None
        seed = OTHER_SEED if random else 0
        power = []
        with open_pool() as pool:
            for size in (fine * STEP, fine):
                batch = make_batch(file, self.vary, together=self.together, mesh_size=size, points=random, seed=seed)
                result = run_batch(replace(batch, bare=True), pool, None)
                power.append(result.replicate_power)
        coarse, smallest = power
        ratio = size_ratio(*(self.sensor.pad.mesh(size) for size in (fine, fine * STEP)))
        limit = smallest + (smallest - coarse) / (ratio**ORDER - 1)
        smooth = "derivative" in study
        true, finest = (_true_figures(result.assign(replicate_power=values), smooth) for values in (limit, smallest))
        numbers = {f"{name}_further": true[name][0] - finest[name][0] for name in true}
        for name, (value, noise) in true.items():
            numbers |= {f"{name}_true": value, f"{name}_noise": noise}
        return numbers, limit


def path_of_error(study: xr.Dataset, limit: xr.DataArray) -> dict[str, float]:
    """Compute how the ratio of true to stated error of a reading changes along the load path (its course), and the
    largest strain.

    Parameters
    ----------
    study : xr.Dataset
        Study of the sweep.
    limit : xr.DataArray
        Readings in the limit of small elements, with the dimensions of the sweep, ``replicate`` and ``taxel``.

    Returns
    -------
    dict[str, float]
        ``course``: true error divided by stated error of the first taxel's reading at the largest force, minus this
        ratio at the first load with a stated error; absent with random paths, because their noise is not an error of
        the elements. ``strain``: the largest strain.
    """
    strain = float(study.largest_strain.max())
    if study.attrs["points"]:
        return {"strain": strain}
    error = (study.replicate_power - limit).mean("replicate").isel(taxel=0)
    ratio = (error / study.mechanics_error.isel(taxel=0)).values
    squares = sum((study[name] ** 2 for name in FORCES if name in study.coords), xr.DataArray(0.0))
    largest = int(squares.values.argmax())
    known = np.flatnonzero(np.isfinite(ratio[: largest + 1]))
    return {"strain": strain, "course": float(ratio[largest] - ratio[known[0]]) if len(known) else math.nan}


def _figures(study: xr.Dataset) -> dict[str, tuple[float, float]]:
    """Value and stated error of each figure of merit of the first taxel, from its first loading."""
    recordings = simulated_experiments(study)
    table = characteristics(recordings.experiments, recordings.off)
    rows = table[(table.taxel == 1) & (table.loading == 1) & table.figure.isin(FIGURES)]
    return {row.figure: (row.value, row.error) for row in rows.itertuples()}


def _true_figures(study: xr.Dataset, smooth: bool) -> dict[str, tuple[float, float]]:
    """Value and error of each figure of merit in the limit of small elements. The only error is the noise of random
    paths.

    With ``smooth``, for sweeps with derivatives, slopes are those of the polynomial through all readings. It does not
    oscillate, because the loads are Chebyshev points.
    """
    figures = _figures(study)
    if smooth:
        (name,) = (str(dim) for dim in study.replicate_power.dims if dim not in ("replicate", "taxel"))
        force, power = study[name].values, study.replicate_power.mean("replicate").isel(taxel=0).values
        rates = Chebyshev.fit(force, power, len(force) - 1).deriv()
        slopes = rates(np.linspace(force.min(), force.max(), 1001))
        figures |= {"max_slope": (float(slopes[np.abs(slopes).argmax()]), 0.0), "zero_slope": (float(rates(0.0)), 0.0)}
    return figures


def figure_cases(seed: int = SEED) -> list[FigureCase]:
    """All cases, in the order of the table. The same seed gives the same cases."""
    random = np.random.default_rng(seed)
    cases = [*(_drawn(random, number) for number in range(1, CASES + 1)), _thin_roof()]
    return [*cases, *(_larger_loads(number, cases[of - 1]) for number, of in enumerate(LARGER, len(cases) + 1))]


def _larger_loads(number: int, case: FigureCase) -> FigureCase:
    """Copy a case with larger loads, at which strains are larger and the error changes more along the load path."""
    loads = [round(FACTOR * load, 5) for load in case.vary["fz"]]
    name = f"{number} larger loads: {case.name.partition(': ')[2].rpartition(', ')[0]}, {loads[-1]:g} N"
    return FigureCase(name, case.sensor, {"fz": loads}, {})


def _thin_roof() -> FigureCase:
    """A case with a thin roof that has a single layer of elements, both on the default mesh and on the second mesh that
    gives the stated error.

    The difference between the two meshes is only a third of the error. The scene is from an earlier draw.
    """
    pad = Pad("parallelepiped", 1, 1, pitch=3.97, wall=0.96, height=2.76, cell_size=3.01, cell_height=1.55)
    reflector = PhotoReflector(led=AnnularLed(law="cosine_power", exponent=4.0))
    roof = Wall(scattering="isotropic", reflectance=0.82)
    sensor = PadSensor(pad, NeoHookean(1.19), photo_reflector=reflector, roof=roof)
    name = "41 thin roof: parallelepiped, 1 x 1, 3.01 mm, roof 1.21 mm, 1.19 MPa, -0.38 N"
    return FigureCase(name, sensor, {"fz": _loads(-0.38)}, {})


def _loads(largest: float) -> list[float]:
    """Chebyshev points from 0 to the largest load, including both ends. A polynomial through readings at these loads
    does not oscillate."""
    return [round(largest * fraction, 5) + 0.0 for fraction in (1 - np.cos(np.linspace(0, np.pi, LOADS))) / 2]


def _drawn(random: np.random.Generator, number: int) -> FigureCase:
    """Draw a random scene; the draw is repeated until its components fit together."""
    kind = OTHER_KINDS.get(number % 10, "normal force")
    cell = CELL_SHAPES[(number - 1) % len(CELL_SHAPES)]
    for _ in range(TRIES):
        try:
            return _with_loads(random, number, kind, *_sensor(random, kind, cell))
        except InputError:
            continue
    raise AssertionError(f"no {cell} cell fits")


def _sensor(random: np.random.Generator, kind: str, cell: str) -> tuple[PadSensor, str]:
    """Draw a random sensor; returns it with a description of its components."""
    size, wall = round(random.uniform(2.0, 3.4), 2), round(random.uniform(0.7, 1.5), 2)
    columns = 2 if kind == "normal force" and random.random() < 0.1 else 1
    roof = round(random.uniform(1.0, 3.0), 2)
    cell_height = 0.5 + size / 2 if cell == "hemispheric" else round(random.uniform(1.2, 2.2), 2)
    pad = Pad(
        cell, 1, columns, pitch=round(size + wall, 2), wall=wall, height=round(cell_height + roof, 2), cell_size=size,
        cell_height=None if cell == "hemispheric" else cell_height,
    )  # fmt: skip
    law = str(random.choice(["uniform_solid_angle", "lambertian", "cosine_power"], p=[0.4, 0.3, 0.3]))
    law_parameters: dict[str, dict[str, Any]] = {
        "uniform_solid_angle": {"cone_angle": round(random.uniform(30, 90))},
        "cosine_power": {"exponent": 4.0},
    }
    led = AnnularLed(law=law, **law_parameters.get(law, {}))
    walls = {region: _wall(random) for region in ("roof", "side")}
    if random.random() < 0.8:  # scenes whose sides reflect take some minutes each
        walls["side"] = Wall(scattering="absorbing")
    if kind == "random paths":
        slope = round(random.uniform(5, 20), 1)
        walls["roof"] = Wall(scattering="rough_mirror", reflectance=0.9, rms_slope=slope)
    modulus = round(math.exp(random.uniform(math.log(0.3), math.log(3.0))), 2)
    material: Any = NeoHookean(modulus) if random.random() < 0.7 else MooneyRivlin(0.15 * modulus, modulus / 60)
    if kind == "viscoelastic":
        material = Viscoelastic(material, ((0.15, 2.0), (0.1, 20.0)))
    spacing = round(random.uniform(0.6, 0.9), 2)
    reflector = PhotoReflector(spacing=spacing, led=led)
    sensor = PadSensor(pad, material, photo_reflector=reflector, roof=walls["roof"], side=walls["side"])
    name = (
        f"{cell}, 1 x {columns}, {size:g} mm, walls {wall:g} mm, roof {roof:g} mm, "
        f"{type(getattr(material, 'law', material)).__name__} {modulus:g} MPa, LED {law}, roof "
        f"{_words(walls['roof'])}, sides {_words(walls['side'])}"
    )
    return sensor, name


def _wall(random: np.random.Generator) -> Wall:
    scattering = str(random.choice(["lambertian", "isotropic"]))
    return Wall(scattering=scattering, reflectance=round(random.uniform(0.4, 0.95), 2))


def _words(wall: Wall) -> str:
    return wall.scattering if wall.scattering == "absorbing" else f"{wall.scattering} {wall.reflectance:g}"


def _with_loads(random: np.random.Generator, number: int, kind: str, sensor: PadSensor, name: str) -> FigureCase:
    """Make the case of a sensor, with loads that compress the pad by a few percent."""
    x, y, _ = sensor.pad.extent
    law: Any = getattr(sensor.material, "law", sensor.material)
    modulus = law.youngs_modulus
    largest = -float(f"{math.exp(random.uniform(*np.log(STRAINS))) * modulus * x * y:.2g}")
    loads = _loads(largest)
    vary: dict[str, list[float]] = {"fz": loads}
    together: dict[str, list[float]] = {}
    if kind == "tangential force":
        sensor, vary = replace(sensor, force=(0.0, 0.0, largest)), {"fx": [-round(load / 3, 5) + 0.0 for load in loads]}
    elif kind == "viscoelastic":
        half = loads[::2] if LOADS % 2 else loads[1::2]
        up = [0.0, *half]
        path = [*up, *up[-2::-1]]
        vary, together = {}, {"time": [2.0 * i for i in range(len(path))], "fz": path}
    return FigureCase(f"{number:02d} {kind}: {name}, {largest:g} N", sensor, vary, together)
