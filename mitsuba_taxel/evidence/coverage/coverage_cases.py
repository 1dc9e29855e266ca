"""Settings of pads whose readings are compared with those on much finer elements, the fastest first."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE, ORDER
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow
from mitsuba_taxel.evidence.coverage.touch_cases import FINE_OF_TOUCH, touch_settings
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.mechanics.elements.loads import (
    IndenterDisplacement,
    Load,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
)
from mitsuba_taxel.mechanics.errors.roof_error import size_ratio
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.parameters import REQUIRED
from mitsuba_taxel.sensing import PadSensor, Readings, Scene, measure
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads

FINE = 0.4
"""Largest mesh size of the truth in mm, which is extrapolated from this size and COARSER times that."""
FINER = 2.0
"""Minimum ratio of the mesh sizes of the reading and the truth."""
COARSER = math.sqrt(2)
PITCH_OF_THICK_WALLS = 3.55
TOUCHED = ("sphere", "punch", "cylinder", "plane")
"""Indenters of the settings of touch."""
FINE_OF_DOMES = {"spherical": 0.25, "hemispheric": 0.4}
"""Mesh sizes in mm of the truth of four domes: half of the reading's would take too long."""


@dataclass(frozen=True)
class CoverageCase:
    """One row of the table.

    Attributes
    ----------
    sensor : PadSensor
        Sensor that is read on the default mesh, with its error, and on fine ones.
    file_format : str
        ``.step`` or ``.stl`` if the pad is read from a file; the truth is that of the parametric pad.
    fine : float or None
        Size of the finest elements in mm, if those of the default would take too long.
    """

    name: str
    sensor: PadSensor
    file_format: str = ""
    fine: float | None = None

    def measured(self) -> CoverageRow:
        """The row, measured in this process."""
        began = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            scene = self.sensor.scene() if not self.file_format else self._from_file(Path(folder))
            try:
                here, pad = _read(scene, mechanics_error=True)
                truth, extrapolated = self._truth(pad.mesh_size or pad.pad.default_mesh_size)
            except ComputationError as error:
                return CoverageRow(self.name, str(error))
        stated, power = here.mechanics_error, here.power
        true = power - truth
        assert here.deviation is not None
        within = np.abs(true) <= 2 * stated
        return CoverageRow(
            self.name,
            "; ".join(here.notes) if np.isnan(stated).any() else "",
            elements=len(pad.state.mesh.tets),
            true=float(np.max(np.abs(true) / power)),
            corrected=float(np.max(np.abs(true - ERROR_SHARE * here.deviation) / power)),
            stated=float(np.max(stated / power)),
            light=float(np.max(here.geometry_error / power)),
            extrapolated=float(np.max(extrapolated / power)),
            readings=len(power),
            within=int(within.sum()),
            seconds=time.process_time() - began,
        )

    def failed(self, end: str) -> CoverageRow:
        """The row of a process that returned none."""
        return CoverageRow(self.name, end)

    def _truth(self, mesh_size: float) -> tuple[np.ndarray, np.ndarray]:
        """(T,) W in the limit of small elements, smaller than the reading's of ``mesh_size`` in mm, and (T,) W, its
        change by the extrapolation from the finest."""
        size = self.fine or min(FINE, mesh_size / FINER)
        scene = self.sensor.scene()
        (coarse, larger), (fine, smaller) = (_read(scene.with_mesh_size(h)) for h in (COARSER * size, size))
        ratio = size_ratio(smaller.state.mesh, larger.state.mesh)
        further = (fine.power - coarse.power) / (ratio**ORDER - 1)
        return fine.power + further, np.abs(further)

    def _from_file(self, folder: Path) -> Scene:
        """The scene with its pad as a file."""
        file = folder / f"pad{self.file_format}"
        (_write_step if self.file_format == ".step" else _write_stl)(self.sensor.pad, file)
        source = self.sensor.scene().source
        assert isinstance(source, dict)
        dimensions = {field.name for field in fields(Pad)}
        pad = {name: value for name, value in source["pad"].items() if name not in dimensions}
        return Scene({**source, "pad": {**pad, "filename": str(file)}})


def _read(scene: Scene, mechanics_error: bool = False) -> tuple[Readings, PadShape]:
    """Readings without random numbers, by patches that do not depend on the elements, and the pad."""
    ready = prepare(scene)
    (pad,) = loaded_pads(ready.scene)
    readings = measure(ready, mechanics_error=mechanics_error)
    if readings.points:
        raise ComputationError("the light of this setting needs random paths.")
    return readings, pad


def _write_stl(pad: Pad, file: Path) -> None:
    """Write the surface of a pad with flat faces only."""
    import trimesh

    mesh = pad.mesh(pad.default_mesh_size)
    trimesh.Trimesh(mesh.points, mesh.faces[:, :3]).export(file)


def _write_step(pad: Pad, file: Path) -> None:
    """Write the solid of a pad of parallelepiped cells."""
    from netgen.occ import Box, Pnt

    x, y, _ = (extent / 2 for extent in pad.extent)
    solid, half = Box(Pnt(-x, -y, 0), Pnt(x, y, pad.height)), pad.cell_size / 2
    for u, v in pad.cell_centres:
        solid = solid - Box(Pnt(u - half, v - half, -1), Pnt(u + half, v + half, pad.top_of_cell))
    solid.WriteStep(str(file))


def coverage_cases() -> list[CoverageCase]:
    """The rows of the table, in its order."""
    kinds = (_one_cell, _loads, _four_cells, _files, _ten_cells, _further_kinds, _touched)
    return [case for kind in kinds for case in kind()]


def _pad(cell: str, rows: int, columns: int, wall: float) -> Pad:
    return Pad(cell, rows, columns, pitch=min(2.55 + wall, PITCH_OF_THICK_WALLS), wall=wall)


def _one_cell() -> Iterator[CoverageCase]:
    for cell in CELL_SHAPES:
        for wall in (1.0, 0.7, 0.5, 0.3):
            sensor = PadSensor(_pad(cell, 1, 1, wall), force=(0.0, 0.0, -1.0))
            yield CoverageCase(f"{cell}, 1 x 1, wall {wall:g} mm, -1 N", sensor)


def _loads() -> Iterator[CoverageCase]:
    for cell, wall in zip(CELL_SHAPES, (0.5, 0.7, 1.0, 0.5), strict=True):
        pad, where = _pad(cell, 1, 1, wall), f"{cell}, 1 x 1, wall {wall:g} mm"
        loads: dict[str, tuple[Load, Sequence[float]]] = {
            "plate, -1 N": (PlateForce(), (0.0, 0.0, -1.0)),
            "plate moved by 0.1 mm": (PlateDisplacement(), (0.0, 0.0, -0.1)),
            "pressure of 0.05 MPa": (Pressure(), (0.05,)),
            "patch of 2 mm x 2 mm, -0.5 N": (PatchForce((0.0, 0.0), (2.0, 2.0)), (0.0, 0.0, -0.5)),
        }
        for name, (load, force) in loads.items():
            yield CoverageCase(f"{where}, {name}", PadSensor(pad, force=force, load=load))
        yield CoverageCase(f"{where}, 0.5 N along x at -0.5 N", PadSensor(pad, force=(0.5, 0.0, -0.5)))


def _four_cells() -> Iterator[CoverageCase]:
    for cell, wall, force in zip(CELL_SHAPES, (0.5, 0.7, 0.3, 0.5), (-3.5, -5.0, -2.0, -3.5), strict=True):
        sensor = PadSensor(_pad(cell, 2, 2, wall), force=(0.0, 0.0, force))
        fine = FINE_OF_DOMES.get(cell)
        truth = f" (truth: {fine:g} mm)" if fine else ""
        yield CoverageCase(f"{cell}, 2 x 2, wall {wall:g} mm, {force:g} N{truth}", sensor, fine=fine)


def _further_kinds() -> Iterator[CoverageCase]:
    """All registered kinds that no other setting has, so that a new one is judged without being named here: shapes with
    walls of several thicknesses, and laws and indenters on shapes in turn."""
    shapes = [name for name in CellShape.kinds() if name not in CELL_SHAPES]
    for cell in shapes:
        for wall in (1.0, 0.5, 0.3):
            sensor = PadSensor(_pad_of_kind(cell, wall), force=(0.0, 0.0, -1.0))
            yield CoverageCase(f"{cell}, 1 x 1, wall {wall:g} mm, -1 N", sensor)
    turn = cycle([*shapes, *CELL_SHAPES])
    for name, law in Material.kinds().items():
        cell = next(turn)
        made: Any = law
        sensor = PadSensor(_pad_of_kind(cell, 0.7), made(**_required(law)), force=(0.3, 0.0, -1.0))
        yield CoverageCase(f"{cell}, 1 x 1, wall 0.7 mm, {name}, 0.3 N along x at -1 N", sensor)
    for name, body in IndenterShape.kinds().items():
        if name not in TOUCHED and name != "file":
            for cell, at in zip(turn, ((0.0, 0.0), (0.6, 0.2)), strict=False):
                load = IndenterDisplacement(Indenter(name, at=at, **_required(body)))
                sensor = PadSensor(_pad_of_kind(cell, 1.0), load=load, force=(0.0, 0.0, -0.2))
                words = f"{cell}, 1 x 1, {name} at {at} mm, 0.2 mm deep (truth: {FINE_OF_TOUCH:g} mm)"
                yield CoverageCase(words, sensor, fine=FINE_OF_TOUCH)


def _pad_of_kind(cell: str, wall: float) -> Pad:
    """A pad of one cell of any shape; that of a profile is as a hemisphere's."""
    if cell == "profile":
        return _pad("hemispheric", 1, 1, wall).as_profile()
    return Pad(cell, 1, 1, wall=wall, **_required(CellShape.named(cell)))


def _required(kind: type[Kind]) -> dict[str, Any]:
    """Values for the parameters of a kind that have no default: lengths of some mm, moduli of silicones, and ratios
    well above 1."""
    by_unit = {"mm": (2.0, 3.0, 1.5), "MPa": (0.5, 0.3), "": (3.0,)}
    required = [(name, each.unit) for name, each in kind.own_parameters().items() if each.default is REQUIRED]
    values = {unit: cycle(numbers) for unit, numbers in by_unit.items()}
    return {name: next(values[unit]) for name, unit in required}


def _touched() -> Iterator[CoverageCase]:
    for name, sensor in touch_settings():
        yield CoverageCase(f"{name} (truth: {FINE_OF_TOUCH:g} mm)", sensor, fine=FINE_OF_TOUCH)


def _files() -> Iterator[CoverageCase]:
    for file_format in (".step", ".stl"):
        for wall in (1.0, 0.5):
            sensor = PadSensor(_pad("parallelepiped", 1, 1, wall), force=(0.0, 0.0, -1.0))
            name = f"parallelepiped as {file_format[1:].upper()}, 1 x 1, wall {wall:g} mm, -1 N"
            yield CoverageCase(name, sensor, file_format)


def _ten_cells() -> Iterator[CoverageCase]:
    for cell in ("parallelepiped", "cylindrical"):
        sensor = PadSensor(_pad(cell, 2, 5, 0.5), force=(0.0, 0.0, -10.0))
        yield CoverageCase(f"{cell}, 2 x 5, wall 0.5 mm, -10 N", sensor)
