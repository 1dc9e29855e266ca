"""The pads of the experiments, with 6 x 2 cells, the layer steps of a printed mould, and walls that are not ideal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import pandas as pd
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.characterise import characteristics, simulated_experiments
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies
from mitsuba_taxel.evidence.paper.scenes import PITCH, scene_text
from mitsuba_taxel.studies import sweep
from mitsuba_taxel.studies.plan.files import make_folder

PADS = {"one cell": (1, 1), "6 x 2 cells": (6, 2)}
"""Rows and columns of the pads. Forces per cell are those of the experiments, whose pads have 6 x 2 cells."""
CELL, PAD = PADS
LAYERS = (0.0, 0.05, 0.1, 0.2)
"""Heights of a printed layer in mm; 0 is a smooth mould."""
DIRECTIONS = {"z": "0, 0, 1", "x": "1, 0, 0"}
WHITE = "white, Lambertian 0.9"
ROOFS: dict[str, dict[str, Any]] = {
    WHITE: {"scattering": "lambertian", "roof_reflectance": 0.9},
    "isotropic": {"scattering": "isotropic", "roof_reflectance": 1},
    "Lambertian": {"scattering": "lambertian", "roof_reflectance": 1},
}
"""Roofs; the reflectance of white silicone is an assumption, as no measurement at the LED's wavelength is known."""
THIN_PAINT = "thin paint, Lambertian 0.5"
MORE_ROOFS = ROOFS | {THIN_PAINT: {"scattering": "lambertian", "roof_reflectance": 0.5}}
SIDES = (0.0, 0.05, 0.2)
"""Reflectances of the black sides, Lambertian."""
POINTS = 4096
"""Light paths for each reading and randomisation. Differences between loads go through material points; for smooth
cells too this is less work than derivatives without random numbers."""
MESH_SIZE = 1.25
"""Size of the finite elements in mm: their error is far below the differences between walls, and is stated."""
LOADS: dict[str, tuple[tuple[float, ...], dict[str, float]]] = {
    "fz": ((0, -2.5, -5, -7.5, -10), {}),
    "fx": ((0, 1, 2.5, 4), {"fz": -paper.MEASURED_FORCE}),
    "fy": ((0, 1, 2.5, 4), {"fz": -paper.MEASURED_FORCE}),
}
"""Steps of each force in N on 6 x 2 cells, and constant forces: normal up to the experiments' force, then tangential
under it."""


class Change(NamedTuple):
    """A change of the assembly or the load of a pad from a printed mould, in addition to the walls.

    Attributes
    ----------
    shift : tuple[float, float, float]
        Shift (x, y, z) of all packages, in mm.
    load : str
        Parameters of the load, as XML elements of a scene.
    tangential : tuple[str, ...]
        Names of the tangential forces for which readings are computed.
    """

    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    load: str = ""
    tangential: tuple[str, ...] = ("fx", "fy")


AS_DESIGNED = ""
CHANGES = {
    AS_DESIGNED: Change(),
    "packages 0.2 mm off along x": Change(shift=(0.2, 0, 0)),
    "packages 0.2 mm off along y": Change(shift=(0, 0.2, 0)),
    "packages 0.1 mm lower": Change(shift=(0, 0, -0.1)),
    "packages 0.2 mm higher": Change(shift=(0, 0, 0.2)),
    "flange bonded to the top": Change(load='<string name="load" value="plate_force"/>'),
    "flange in contact": Change(
        load='<string name="load" value="indenter_force"/> <string name="indenter" value="plane"/>', tangential=()
    ),
}
"""Other explanations by name; a plane without friction transmits no tangential force."""


@dataclass(frozen=True)
class MouldWalls:
    """A pad of the experiments: shape of its cells, mould and walls.

    Attributes
    ----------
    cell : str
        Shape of the cells.
    layer : float
        Height of a printed layer in mm; 0 for a smooth mould.
    direction : str
        Print direction, a key of `DIRECTIONS`; empty for a smooth mould.
    roof : str
        Scattering of the roofs, a key of `MORE_ROOFS`.
    side : float
        Reflectance of the side walls.
    change : str
        Change of the assembly, a key of `CHANGES`.
    pad : str
        Numbers of cells, a key of `PADS`.
    """

    cell: str
    layer: float = 0.0
    direction: str = ""
    roof: str = WHITE
    side: float = 0.0
    change: str = AS_DESIGNED
    pad: str = PAD

    @property
    def share(self) -> float:
        """Force on the pad, relative to the force on a pad of 6 x 2 cells, for the same force per cell."""
        return math.prod(PADS[self.pad]) / math.prod(PADS[PAD])

    @property
    def mould(self) -> str:
        """Description of the mould in words, such as its layer height and print direction."""
        return f"{self.layer:g} mm along {self.direction}" if self.layer else "smooth"

    @property
    def folder(self) -> str:
        """Folder of the studies of this pad, relative to the folder of the rerun."""
        words = f"{self.cell} {self.mould} {self.roof} sides {self.side:g} {self.change} {self.pad}"
        return "mould/" + "_".join(words.replace(",", "").split())

    @property
    def finish(self) -> str:
        """Parameters of the finish, as XML elements of a scene."""
        if not self.layer:
            return ""
        return (
            f'<string name="finish" value="layer_steps"/> <float name="layer_height" value="{self.layer:g}"/> '
            f'<vector name="print_direction" value="{DIRECTIONS[self.direction]}"/>'
        )

    def scene(self, rows: range, columns: range) -> str:
        """The scene of the pad, with photo-reflectors in some rows and columns of cells only.

        Parameters
        ----------
        rows, columns : range
            Numbers of the rows and columns that are read, from 0; rows count from +y, columns from -x.

        Returns
        -------
        str
            XML.
        """
        change, (of_pad, across) = CHANGES[self.change], PADS[self.pad]
        x = (0.5 * (columns[0] + columns[-1]) - 0.5 * (across - 1)) * PITCH + change.shift[0]
        y = (0.5 * (of_pad - 1) - 0.5 * (rows[0] + rows[-1])) * PITCH + change.shift[1]
        taxels = [row * across + column + 1 for row in rows for column in columns]
        return scene_text("mould").format(
            rows=of_pad,
            columns=across,
            cells="all" if self.layer else ", ".join(map(str, taxels)),  # a finish applies to all cells
            load=change.load,
            finish=self.finish,
            read_rows=len(rows),
            read_columns=len(columns),
            x=x,
            y=y,
            z=change.shift[2],
        )


def design() -> Iterator[MouldWalls]:
    """Cases of the study of printed moulds: a base case with smooth white roofs and black sides, changes of one factor
    of it at a time, and some combinations of extremes.

    Changes of the assembly, such as dies off centre, are factors, too. All variations are computed for a pad of one
    cell, and those with the largest effects for whole pads as well.
    """
    smooth = MouldWalls("", pad=CELL)
    every, round_cells = tuple(paper.MEASURED_NORMAL), ("spherical", "hemispheric")
    core = (
        (smooth, every),
        (replace(smooth, layer=0.1, direction="z"), round_cells),
        (replace(smooth, roof="isotropic"), every),
        (replace(smooth, layer=0.2, direction="z", side=0.2), round_cells),
    )
    of_cells = (
        *core,
        (replace(smooth, side=0.2), every),
        (replace(smooth, layer=0.2, direction="z"), round_cells),
        (replace(smooth, change="packages 0.2 mm off along x"), every),
        (replace(smooth, change="packages 0.1 mm lower"), every),
        (replace(smooth, change="flange bonded to the top"), every),
        (replace(smooth, layer=0.05, direction="z"), round_cells),
        (replace(smooth, roof=THIN_PAINT), every),
        (replace(smooth, layer=0.1, direction="x"), every),
        (replace(smooth, layer=0.1, direction="z", roof="isotropic"), round_cells),
        (replace(smooth, change="flange in contact"), every),
        (replace(smooth, roof="Lambertian"), every),
        (replace(smooth, side=0.05), every),
        (replace(smooth, change="packages 0.2 mm higher"), every),
        (replace(smooth, change="packages 0.2 mm off along y"), every),
        (replace(smooth, layer=0.2, direction="x"), every),
    )
    for wall, cells in (*of_cells, *((replace(wall, pad=PAD), cells) for wall, cells in core)):
        yield from (replace(wall, cell=cell) for cell in cells)


def rest() -> Iterator[MouldWalls]:
    """Whole pads that :func:`design` omits: all other combinations of cell shape, mould, roof and sides. Those with
    black sides come first.
    """
    moulds = [(layer, direction) for layer in LAYERS for direction in (DIRECTIONS if layer else ("",))]
    done = set(design())
    for side, roof, (layer, direction), cell in product(SIDES, ROOFS, moulds, paper.MEASURED_NORMAL):
        wall = MouldWalls(cell, layer, direction, roof, side)
        if wall not in done:
            yield wall


def moulds(
    store: PaperStudies, workers: int | None, walls: Iterator[MouldWalls]
) -> dict[MouldWalls, dict[str, xr.Dataset]]:
    """Compute readings of pads, by pad and then by force (fz, fx, fy).

    Under a normal force, the pad and its load are symmetric about y = 0, and the taxels of one half are read.
    Tangential forces are computed for whole pads only, after the normal forces of all pads; the most sensitive taxel
    under the normal force is read.

    Parameters
    ----------
    store : PaperStudies
        Store of the studies. If it is read-only, the result has only the pads whose studies are complete.
    workers : int or None
        Number of worker processes; None for this one.
    walls : Iterator[MouldWalls]
        Pads, from :func:`design` or :func:`rest`.

    Raises
    ------
    MissingStudy
        if no study is complete.
    """
    rows = list(walls)
    normal: dict[MouldWalls, xr.Dataset] = {}
    for wall in rows:
        with suppress(MissingStudy):
            across, columns = PADS[wall.pad]
            normal[wall] = _load(store, wall, "fz", workers, range((across + 1) // 2), range(columns))
    if not normal:
        raise MissingStudy("mould")
    studies = {wall: {"fz": study} for wall, study in normal.items()}
    for wall, study in normal.items():
        if wall.pad != PAD:
            continue
        row, column = divmod(most_sensitive(study) - 1, PADS[PAD][1])
        for force in CHANGES[wall.change].tangential:
            with suppress(MissingStudy):
                of_one = range(row, row + 1), range(column, column + 1)
                studies[wall][force] = _load(store, wall, force, workers, *of_one)
    return studies


def _load(
    store: PaperStudies, wall: MouldWalls, force: str, workers: int | None, rows: range, columns: range
) -> xr.Dataset:
    on_pad, constant = LOADS[force]
    steps = [wall.share * value for value in on_pad]
    values = {**MORE_ROOFS[wall.roof], "side_reflectance": wall.side, "cell": wall.cell}
    values |= {name: wall.share * value for name, value in constant.items()}
    text = wall.scene(rows, columns)

    def compute() -> xr.Dataset:
        scene = store.folder / wall.folder / f"{force}.xml"
        make_folder(scene.parent)
        write_text(scene, text)
        study = sweep(
            scene,
            {force: steps},
            values,
            points=POINTS,
            mesh_size=MESH_SIZE,
            derivatives=(force,),
            workers=workers,
        )
        if study.attrs["failures"]:
            raise ComputationError(study.attrs["failures"].splitlines()[0])
        return study

    request = {"values": values, "scene": text, force: steps, "points": POINTS}
    return store.study(f"{wall.folder}/{force}", request, compute)


class MouldFigures(NamedTuple):
    """Figures of merit of a pad, each a value and its error; NaN if not computed.

    Attributes
    ----------
    least, most : tuple[float, float]
        Mean slopes of the least and of the most sensitive taxel under a normal force, W/N, as in Table 2.
    nonlinearity : tuple[float, float]
        Nonlinearity (equation 7) of the most sensitive taxel, in percent, as in Table 4.
    along_x, along_y : tuple[float, float]
        Mean slope of the most sensitive taxel under tangential forces, W/N, as in Table 3.
    taxel : int
        Number of the most sensitive taxel.
    """

    least: tuple[float, float]
    most: tuple[float, float]
    nonlinearity: tuple[float, float]
    along_x: tuple[float, float]
    along_y: tuple[float, float]
    taxel: int

    def numbers(self) -> dict[str, tuple[float, float]]:
        """All values and errors as numbers, by name."""
        return {name: pair for name, pair in self._asdict().items() if name != "taxel"}


def most_sensitive(study: xr.Dataset) -> int:
    """Number of the taxel with the largest mean slope under the force of a study."""
    return int(_table(study).xs("mean_slope")["value"].abs().idxmax())


def mould_figures(studies: Mapping[str, xr.Dataset], share: float = 1.0) -> MouldFigures:
    """Compute the figures of merit of a pad as the paper defines them.

    Parameters
    ----------
    studies : Mapping[str, xr.Dataset]
        Studies by force, from :func:`moulds`.
    share : float
        Force on the pad relative to that on 6 x 2 cells. The resulting slopes are per newton on 6 x 2 cells.

    Returns
    -------
    MouldFigures
        Figures of merit. Slopes are positive where readings rise with compression, or with the tangential force.
    """
    tables = {force: _table(study) for force, study in studies.items()}
    normal = tables["fz"].xs("mean_slope").sort_values("value", key=abs)
    taxel = int(normal.index[-1])

    def tangential(force: str) -> tuple[float, float]:
        if force not in tables:
            return math.nan, math.nan
        return _pair(tables[force].xs("mean_slope").iloc[0], share)

    least, most = (_pair(row, -share) for _, row in normal.iloc[[0, -1]].iterrows())  # compression is negative
    nonlinearity = _pair(tables["fz"].loc["nonlinearity", taxel])
    return MouldFigures(least, most, nonlinearity, tangential("fx"), tangential("fy"), taxel)


def _pair(row: pd.Series, factor: float = 1.0) -> tuple[float, float]:
    return factor * float(row["value"]), abs(factor) * float(row["error"])


def _table(study: xr.Dataset) -> pd.DataFrame:
    """Table of the value and error of each figure of merit and taxel."""
    simulated = simulated_experiments(study)
    return characteristics(simulated.experiments, simulated.off).set_index(["figure", "taxel"])[["value", "error"]]
