"""Settings of pads for `taxel bench coverage`, the fastest first. Their readings are compared with reference values
from much finer elements."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import cycle
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE, ORDER
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow
from mitsuba_taxel.evidence.coverage.touch_cases import FINE_OF_TOUCH, touch_settings
from mitsuba_taxel.evidence.rows.kind_examples import (
    generator,
    indenter_of,
    law_of,
    other_cells,
    other_indenters,
    pad_of,
)
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.mechanics.elements.loads import (
    IndenterDisplacement,
    Load,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    PlateWrench,
    Pressure,
)
from mitsuba_taxel.mechanics.errors.roof_error import size_ratio
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.sensing import PadSensor, Readings, Scene, measure
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads

FINE = 0.4
"""Largest mesh size of the reference in mm. The reference value is extrapolated from readings with this mesh size and
with `COARSER` times this size."""
FINER = 2.0
"""Smallest ratio between the mesh sizes of the reading and of the reference."""
COARSER = math.sqrt(2)
LEAST_RATIO = 1.1
"""Least actual ratio of element sizes of the two meshes of the reference. With less, coarser meshes are used."""
REFINEMENTS = 2
"""Largest number of times that the elements of a reference are made smaller, by `COARSER`, because its extrapolation
exceeds the stated error."""
PITCH_OF_THICK_WALLS = 3.55
TOUCHED = ("sphere", "punch", "cylinder", "plane")
"""Indenters of `touch_settings`."""
SEED = 53
FILLETS = (0.1, 0.4)
"""Range of the radii of rounded edges, mm."""
FINE_OF_DOMES = {"spherical": 0.25, "hemispheric": 0.4}
"""Mesh sizes in mm of the references of 2 x 2 domes, for which half the mesh size of the reading would take too
long."""


@dataclass(frozen=True)
class CoverageCase:
    """One setting: a sensor whose reading is compared with a reference value.

    Attributes
    ----------
    name : str
        Description of the setting: the label of its row in the table of the page.
    sensor : PadSensor
        Sensor that is read on the default mesh, with its stated error, and on fine meshes for the reference value.
    file_format : str
        ``.step`` or ``.stl`` if the pad is imported from a file; the reference value is that of the parametric pad.
    fine : float or None
        Size in mm of the finest elements of the reference value, if `FINE` would take too long.
    """

    name: str
    sensor: PadSensor
    file_format: str = ""
    fine: float | None = None

    def measured(self) -> CoverageRow:
        """Compare stated and true error of this setting in the present process, and return the row of the table."""
        began = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            scene = self.sensor.scene() if not self.file_format else self._from_file(Path(folder))
            try:
                default, pad = _read(scene, mechanics_error=True)
                mesh_size = pad.mesh_size or pad.pad.default_mesh_size
                size = self.fine or min(FINE, mesh_size / FINER)
                truth, extrapolated = self._truth(size, mesh_size)
                # A reference that is less certain than the stated error cannot confirm it.
                for _ in range(REFINEMENTS):
                    if np.all(extrapolated <= default.mechanics_error):
                        break
                    size /= COARSER
                    truth, extrapolated = self._truth(size, mesh_size)
            except ComputationError as error:
                return CoverageRow(self.name, str(error))
        stated_error, power = default.mechanics_error, default.power
        true_error = power - truth
        assert default.deviation is not None
        within = np.abs(true_error) <= 2 * stated_error
        return CoverageRow(
            self.name,
            "; ".join(default.notes) if np.isnan(stated_error).any() else "",
            elements=len(pad.state.mesh.tets),
            true=float(np.max(np.abs(true_error) / power)),
            corrected=float(np.max(np.abs(true_error - ERROR_SHARE * default.deviation) / power)),
            stated=float(np.max(stated_error / power)),
            light=float(np.max(default.geometry_error / power)),
            extrapolated=float(np.max(extrapolated / power)),
            readings=len(power),
            within=int(within.sum()),
            seconds=time.process_time() - began,
        )

    def failed(self, end: str) -> CoverageRow:
        """Row of a case whose process ended without a result, for the reason ``end``."""
        return CoverageRow(self.name, end)

    def _truth(self, size: float, mesh_size: float) -> tuple[np.ndarray, np.ndarray]:
        """Compute reference values: the power (T,) in W of T taxels in the limit of small elements, and the change (T,)
        of the power by the extrapolation from the finest elements.

        ``size`` is the mesh size of the finest elements, and ``mesh_size`` that of the reading, in mm.
        """
        fine, smaller = _read(self.sensor.scene().with_mesh_size(size))
        # Fillets and thin walls limit the size of elements: two meshes may differ far less than their nominal sizes.
        for coarser in (COARSER * size, COARSER**2 * size, mesh_size):
            coarse, larger = _read(self.sensor.scene().with_mesh_size(coarser))
            ratio = size_ratio(smaller.state.mesh, larger.state.mesh)
            if ratio >= LEAST_RATIO:
                break
        else:
            raise ComputationError("no two meshes for the reference differ enough to extrapolate from.")
        correction = (fine.power - coarse.power) / (ratio**ORDER - 1)
        return fine.power + correction, np.abs(correction)

    def _from_file(self, folder: Path) -> Scene:
        """Make the scene with its pad imported from a file."""
        file = folder / f"pad{self.file_format}"
        (_write_step if self.file_format == ".step" else _write_stl)(self.sensor.pad, file)
        source = self.sensor.scene().source
        assert isinstance(source, dict)
        dimensions = {field.name for field in fields(Pad)}
        pad = {name: value for name, value in source["pad"].items() if name not in dimensions}
        return Scene({**source, "pad": {**pad, "filename": str(file)}})


def _read(scene: Scene, mechanics_error: bool = False) -> tuple[Readings, PadShape]:
    """Read a scene without random numbers, with patches for the light that do not depend on the finite elements;
    returns the readings and the pad."""
    ready = prepare(scene)
    (pad,) = loaded_pads(ready.scene)
    readings = measure(ready, mechanics_error=mechanics_error)
    if readings.points:
        raise ComputationError("the light of this setting needs random paths.")
    return readings, pad


def _write_stl(pad: Pad, file: Path) -> None:
    """Write the surface of a pad, whose faces must all be flat, as an STL file."""
    import trimesh

    mesh = pad.mesh(pad.default_mesh_size)
    trimesh.Trimesh(mesh.points, mesh.faces[:, :3]).export(file)


def _write_step(pad: Pad, file: Path) -> None:
    """Write a pad with parallelepiped cells as a solid in a STEP file."""
    from netgen.occ import Box, Pnt

    x, y, _ = (extent / 2 for extent in pad.extent)
    solid, half = Box(Pnt(-x, -y, 0), Pnt(x, y, pad.height)), pad.cell_size / 2
    for u, v in pad.cell_centres:
        solid = solid - Box(Pnt(u - half, v - half, -1), Pnt(u + half, v + half, pad.top_of_cell))
    solid.WriteStep(str(file))


def coverage_cases() -> list[CoverageCase]:
    """All settings, in the order of the table."""
    groups = (_one_cell, _loads, _four_cells, _files, _ten_cells, _other_kinds, _rounded, _blunt, _touched)
    return [case for group in groups for case in group()]


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
            "tilting plate, -0.5 N and 2 N mm": (PlateWrench(), (0.0, 0.0, -0.5, 0.0, 2.0, 0.0)),
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
        reference = f" (reference: {fine:g} mm)" if fine else ""
        yield CoverageCase(f"{cell}, 2 x 2, wall {wall:g} mm, {force:g} N{reference}", sensor, fine=fine)


def _other_kinds() -> Iterator[CoverageCase]:
    """Settings for all registered kinds of cells, material laws and indenters that no other setting contains. Cells
    have walls of several thicknesses; laws and indenters are combined with one cell shape after another. A new kind is
    tested without being named here."""
    for cell in other_cells():
        for wall in (1.0, 0.5, 0.3):
            sensor = PadSensor(pad_of(cell, rows=1, columns=1, wall=wall), force=(0.0, 0.0, -1.0))
            yield CoverageCase(f"{cell}, 1 x 1, wall {wall:g} mm, -1 N", sensor)
    cells = [*other_cells(), *CELL_SHAPES]
    for name, cell in zip(Material.kinds(), cycle(cells), strict=False):
        law = law_of(name)
        down = float(f"{min(1.0, law.shear_modulus):.2g}")  # pads of softer silicones bear smaller forces
        across = float(f"{0.3 * down:.2g}")
        sensor = PadSensor(pad_of(cell, rows=1, columns=1, wall=0.7), law, force=(across, 0.0, -down))
        yield CoverageCase(f"{cell}, 1 x 1, wall 0.7 mm, {name}, {across:g} N along x at {-down:g} N", sensor)
    cells_in_turn = cycle([*cells[-2:], *cells[:-2]])  # for any number of laws
    for name in other_indenters(TOUCHED):
        for cell, at in zip(cells_in_turn, ((0.0, 0.0), (0.6, 0.2)), strict=False):
            load = IndenterDisplacement(indenter_of(name, at=at))
            sensor = PadSensor(pad_of(cell, rows=1, columns=1), load=load, force=(0.0, 0.0, -0.2))
            words = f"{cell}, 1 x 1, {name} at {at} mm, 0.2 mm deep (reference: {FINE_OF_TOUCH:g} mm)"
            yield CoverageCase(words, sensor, fine=FINE_OF_TOUCH)


def _rounded() -> Iterator[CoverageCase]:
    """Settings for all registered cell shapes that can have a fillet, with random wall thickness, fillet radius, load
    and direction. A newly registered shape does not change the other settings. Finishes are not included, because their
    light needs random paths (see `estimators`)."""
    for cell in CellShape.kinds():
        random = generator(SEED, cell)
        wall, fillet = round(random.uniform(0.3, 1.0), 2), round(random.uniform(*FILLETS), 2)
        across, down = round(random.uniform(0.0, 0.3), 2), round(random.uniform(0.4, 1.0), 2)
        try:
            pad = pad_of(cell, rows=1, columns=1, wall=wall, fillet=fillet)
        except InputError:  # no edge between roof and side
            continue
        name = f"{cell}, 1 x 1, wall {wall:g} mm, fillet {fillet:g} mm, {across:g} N along x at {-down:g} N"
        yield CoverageCase(name, PadSensor(pad, force=(across, 0.0, -down)))


def _blunt() -> Iterator[CoverageCase]:
    """Settings for all registered cell shapes whose mouths can be rounded. The outside of the pad is rounded as well
    and, if the shape allows it, the edges of the cell; radii, wall thickness and load are random."""
    for cell in CellShape.kinds():
        random = generator(SEED, f"blunt {cell}")
        wall, down = round(random.uniform(0.5, 1.0), 2), round(random.uniform(0.4, 1.0), 2)
        mouth, outer = (round(random.uniform(0.1, 0.3), 2) for _ in range(2))
        for fillet in (mouth, 0.0):
            try:
                pad = pad_of(cell, rows=1, columns=1, wall=wall, fillet=fillet, mouth_fillet=mouth, outer_fillet=outer)
            except InputError:  # no edge between roof and side, or no mouth that can be rounded
                continue
            name = f"{cell}, 1 x 1, wall {wall:g} mm, mouth rounded by {mouth:g}, outside by {outer:g} mm, {-down:g} N"
            yield CoverageCase(name, PadSensor(pad, force=(0.0, 0.0, -down)))
            break


def _touched() -> Iterator[CoverageCase]:
    for name, sensor in touch_settings():
        yield CoverageCase(f"{name} (reference: {FINE_OF_TOUCH:g} mm)", sensor, fine=FINE_OF_TOUCH)


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
