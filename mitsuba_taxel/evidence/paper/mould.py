"""The pads of the experiments, 6 x 2 cells, with the steps of a printed mould and with walls that are not ideal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import pandas as pd
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.characterise import characteristics, simulated_experiments
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies
from mitsuba_taxel.evidence.paper.scenes import scene_text
from mitsuba_taxel.studies import sweep
from mitsuba_taxel.studies.plan.files import make_folder

ROWS, COLUMNS = 6, 2
LAYERS = (0.0, 0.05, 0.1, 0.2)
"""Heights of a printed layer in mm; 0 is a smooth mould."""
DIRECTIONS = {"z": "0, 0, 1", "x": "1, 0, 0"}
ROOFS: dict[str, dict[str, Any]] = {
    "white, Lambertian 0.9": {"scattering": "lambertian", "roof_reflectance": 0.9},
    "isotropic": {"scattering": "isotropic", "roof_reflectance": 1},
    "Lambertian": {"scattering": "lambertian", "roof_reflectance": 1},
}
"""Roofs; the reflectance of white silicone is an assumption, as no measurement at the LED's wavelength is known."""
SIDES = (0.0, 0.05, 0.2)
"""Reflectances of the black sides, Lambertian."""
POINTS = 16384
"""Light paths for each reading and randomisation: slopes are differences of readings with shared random numbers."""
LOADS: dict[str, tuple[str, dict[str, float]]] = {
    "fz": ("0,-2.5,-5,-7.5,-10", {}),
    "fx": ("0,2,4", {"fz": -paper.MEASURED_FORCE}),
    "fy": ("0,2,4", {"fz": -paper.MEASURED_FORCE}),
}
"""Steps of each force in N, and constant forces: normal up to the experiments' force, then tangential under it."""


@dataclass(frozen=True)
class MouldWalls:
    """Shape of the cells and walls of a pad.

    Attributes
    ----------
    cell : str
        Shape of the cells.
    layer : float
        Height of a printed layer in mm; 0 for a smooth mould.
    direction : str
        Print direction, a key of `DIRECTIONS`; empty for a smooth mould.
    roof : str
        Key of `ROOFS`.
    side : float
        Reflectance of the sides.
    """

    cell: str
    layer: float
    direction: str
    roof: str
    side: float

    @property
    def mould(self) -> str:
        """The mould in words."""
        return f"{self.layer:g} mm along {self.direction}" if self.layer else "smooth"

    @property
    def folder(self) -> str:
        """Folder of the studies, within that of the rerun."""
        words = f"{self.cell} {self.mould} {self.roof} sides {self.side:g}"
        return "mould/" + "_".join(words.replace(",", "").split())

    @property
    def finish(self) -> str:
        """Parameters of the finish, as elements of a scene."""
        if not self.layer:
            return ""
        return (
            f'<string name="finish" value="layer_steps"/> <float name="layer_height" value="{self.layer:g}"/> '
            f'<vector name="print_direction" value="{DIRECTIONS[self.direction]}"/>'
        )


def walls() -> Iterator[MouldWalls]:
    """All combinations; those with black sides come first. A flat roof has no steps along z: it moves to a level."""
    moulds = [(layer, direction) for layer in LAYERS for direction in (DIRECTIONS if layer else ("",))]
    for side, roof, (layer, direction), cell in product(SIDES, ROOFS, moulds, paper.MEASURED_NORMAL):
        yield MouldWalls(cell, layer, direction, roof, side)


def moulds(store: PaperStudies, workers: int | None) -> dict[MouldWalls, dict[str, xr.Dataset]]:
    """Readings of all taxels, by walls and force (fz, fx, fy).

    If the store computes nothing, only walls with complete studies are returned.

    Raises
    ------
    MissingStudy
        if no study is complete.
    """
    studies = {}
    for wall in walls():
        try:
            studies[wall] = {force: _load(store, wall, force, workers) for force in LOADS}
        except MissingStudy:
            continue
    if not studies:
        raise MissingStudy("mould")
    return studies


def _load(store: PaperStudies, wall: MouldWalls, force: str, workers: int | None) -> xr.Dataset:
    steps, constant = LOADS[force]
    values = {**ROOFS[wall.roof], "side_reflectance": wall.side, "cell": wall.cell, **constant}

    def compute() -> xr.Dataset:
        scene = store.folder / wall.folder / "pad.xml"
        make_folder(scene.parent)
        write_text(scene, scene_text("mould").format(rows=ROWS, columns=COLUMNS, finish=wall.finish))
        study = sweep(scene, {force: steps}, values, points=POINTS, workers=workers)
        if study.attrs["failures"]:
            raise ComputationError(study.attrs["failures"].splitlines()[0])
        return study

    request = {"values": values, "finish": wall.finish, force: steps, "points": POINTS}
    return store.study(f"{wall.folder}/{force}", request, compute)


class MouldFigures(NamedTuple):
    """Figures of merit of a pad, each a value and its error.

    Attributes
    ----------
    least, most : tuple[float, float]
        Mean slope of the least and the most sensitive taxel under a normal force, W/N, as in Table 2.
    nonlinearity : tuple[float, float]
        Equation 7 for the most sensitive taxel, in percent, as in Table 4.
    along_x, along_y : tuple[float, float]
        Mean slope of that taxel under tangential forces, W/N, as in Table 3.
    taxel : int
        Number of the most sensitive taxel.
    """

    least: tuple[float, float]
    most: tuple[float, float]
    nonlinearity: tuple[float, float]
    along_x: tuple[float, float]
    along_y: tuple[float, float]
    taxel: int


def mould_figures(studies: Mapping[str, xr.Dataset]) -> MouldFigures:
    """Figures of merit of a pad as the paper defines them.

    Parameters
    ----------
    studies : Mapping[str, xr.Dataset]
        Studies by force, as of :func:`moulds`.

    Returns
    -------
    MouldFigures
        Magnitudes of slopes.
    """
    tables = {force: _table(study) for force, study in studies.items()}
    normal = tables["fz"].xs("mean_slope").abs().sort_values("value")
    taxel = int(normal.index[-1])

    def of(force: str, figure: str) -> tuple[float, float]:
        row = tables[force].loc[figure, taxel].abs()
        return float(row["value"]), float(row["error"])

    least, most = ((float(row["value"]), float(row["error"])) for _, row in normal.iloc[[0, -1]].iterrows())
    return MouldFigures(least, most, of("fz", "nonlinearity"), of("fx", "mean_slope"), of("fy", "mean_slope"), taxel)


def _table(study: xr.Dataset) -> pd.DataFrame:
    """Value and error by figure of merit and taxel."""
    simulated = simulated_experiments(study)
    return characteristics(simulated.experiments, simulated.off).set_index(["figure", "taxel"])[["value", "error"]]
