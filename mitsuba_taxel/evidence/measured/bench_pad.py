"""The measured pad of 5 x 5 cells as a scene, and its load paths under the end of a rod.

The silicone is glued to a rigid grid. Collars of the grid reach into the cells, flush with the cell walls, and hold the
lowest part of these walls; the model of the pad therefore begins at the top of the collars. The plate of the grid lies
on the board, and the packages stand in windows of the plate, level with it. The whole grid is opaque.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import scene_text
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of
from mitsuba_taxel.sensing import Readings, Scene, measure
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

SIDE = 5
"""Cells along each side of the pad."""
TRAVELS = (0.15, 0.3, 0.6, 1.2, 1.7, 1.95, 2.05)
"""Travels of the indenter in mm at which readings are computed."""
POINTS, MESH_SIZE = 256, 1.6
"""Number of light paths for each taxel and randomisation; size in mm of the elements away from cells and indenter,
nearly the largest that the cells permit."""

_BAR = """
    <shape type="cube">
        <transform name="to_world"><scale value="{size}"/><translate value="{centre}"/></transform>
        <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
    </shape>
"""


_WALLS = """
            <bsdf name="side" type="wall">
                <string name="scattering" value="isotropic"/> <float name="reflectance" value="{walls:g}"/>
            </bsdf>"""


class SceneLoad(NamedTuple):
    """Load of the scene, as XML: the defaults of its parameters, and its parameters."""

    defaults: str
    parameters: str


INDENTER = SceneLoad(
    """\
    <default name="indenter" value="sphere"/>
    <default name="radius" value="1"/>
    <default name="friction" value="{friction:g}"/>""",
    """\
        <string name="load" value="indenter_displacement"/>
        <string name="indenter" value="$indenter"/> <float name="indenter_radius" value="$radius"/>
        <float name="indenter_x" value="$x"/> <float name="indenter_y" value="$y"/>
        <float name="friction" value="$friction"/>
        <vector name="displacement" value="0, 0, $uz"/>""",
)
PLATE = SceneLoad(
    "",
    """\
        <string name="load" value="plate_wrench"/>
        <float name="load_x" value="$x"/> <float name="load_y" value="$y"/>
        <vector name="force" value="0, 0, $uz"/>""",
)
"""An indenter that moves by uz in mm, and a plate on which a force uz in N acts, at (x, y)."""


class PadAssumptions(NamedTuple):
    """Assumed values of parameters of the measured pad that are not published.

    Attributes
    ----------
    name : str
        Part of the names of studies with these assumptions; empty for the assumptions of the fit.
    poisson_ratio : float
        Poisson ratio of the silicone.
    collar : float
        Height in mm above the dies up to which the grid supports the walls between the cells.
    walls : float
        Reflectance of these walls.
    friction : float
        Friction coefficient of the indenter.
    """

    name: str = ""
    poisson_ratio: float = NeoHookean().poisson_ratio
    collar: float = measured.COLLAR_HEIGHT
    walls: float = 0.0
    friction: float = 0.0


AS_FITTED = PadAssumptions()


class IndenterPress(NamedTuple):
    """An indenter, a rod with a round or a flat end, and the height of the pad into which it is pressed; all lengths in
    mm.

    Attributes
    ----------
    height : float
        Height of the silicone above the plane of the dies.
    indenter : str
        Shape of the end of the rod: ``sphere`` (round) or ``punch`` (flat).
    radius : float
        Radius of the end of the rod.
    x, y : float
        Position of the tip, relative to the middle of the pad.
    """

    height: float
    indenter: str
    radius: float
    x: float = 0.0
    y: float = 0.0

    def moved(self, x: float, y: float) -> IndenterPress:
        """The same indenter and pad, with the indenter at another position."""
        return self._replace(x=x, y=y)

    @property
    def name(self) -> str:
        position = f"_at_{self.x:g}_{self.y:g}" if self.x or self.y else ""
        return f"{self.indenter}_{self.radius:g}_on_{self.height:g}{position}"


class PressReading(NamedTuple):
    """Force on the indenter in N, for a long-term modulus of 1 MPa, and changes of the taxels' readings relative to
    rest, each with its error.

    ``step_error`` is the error of the stress due to the time steps, relative to the largest stress so far."""

    force: float
    force_error: float
    change: np.ndarray
    change_error: np.ndarray
    step_error: float


def path(
    store: PaperStudies,
    press: IndenterPress,
    travels: tuple[float, ...] = TRAVELS,
    with_errors: bool = False,
    mesh_size: float | None = None,
    assumed: PadAssumptions = AS_FITTED,
) -> xr.Dataset:
    """Compute force and readings while an indenter is pressed into the pad, as a dataset over ``travel`` and ``taxel``.
    It ends where the pad has no equilibrium.

    ``force`` is in N for a modulus of 1 MPa; forces are proportional to the modulus. ``change`` is the change of the
    power relative to rest. Errors, if requested, are total errors. The attribute ``end`` gives the reason if the load
    path ends early; otherwise it is empty.

    Raises
    ------
    ComputationError
        if the load path ends before the first travel.
    """
    size = mesh_size or MESH_SIZE
    settings = (f"in_{size:g}" if mesh_size else "", "with_errors" if with_errors else "", assumed.name)
    name = "_".join([f"pressed/{press.name}", *filter(None, settings)])
    request = {**press._asdict(), "travels": travels, "points": POINTS, "mesh_size": size, "errors": with_errors}
    file = store.folder / "pressed" / "_".join(filter(None, ("pad", assumed.name)))
    return store.study(
        name, request, lambda: _computed(file.with_suffix(".xml"), press, travels, with_errors, size, assumed)
    )


def _computed(
    file: Path,
    press: IndenterPress,
    travels: tuple[float, ...],
    with_errors: bool,
    mesh_size: float,
    assumed: PadAssumptions,
) -> xr.Dataset:
    write_scene(file, assumed)
    defines = defines_of(press, assumed) | {"mesh_size": mesh_size}
    at_rest = measure(Scene(file, defines), points=POINTS, mechanics_error=False)
    rows: list[PressReading] = []
    end = ""
    for travel in travels:
        try:
            rows.append(read(Scene(file, defines | {"uz": -travel}), at_rest, POINTS, with_errors))
        except ComputationError as error:
            if not rows:
                raise
            end = str(error)
            break
    study = dataset("travel", rows)
    return study.assign_coords(travel=("travel", np.array(travels[: len(rows)]), {"units": "mm"})).assign_attrs(end=end)


def defines_of(press: IndenterPress, assumed: PadAssumptions = AS_FITTED) -> dict[str, Any]:
    """Values of the scene's parameters for an indenter and assumptions, by name."""
    return press._asdict() | {"height": press.height - assumed.collar}


def read(scene: Scene, at_rest: Readings, points: int, with_errors: bool = False) -> PressReading:
    """Read one state of the pad with ``points`` light paths for each taxel and randomisation: force and changes of the
    taxels."""
    readings = measure(scene, points=points, mechanics_error=with_errors)
    state = deformed_pads(scene.load())[0].state
    force = -indentation_of(state)[1].nodal_forces.sum(axis=0)[2]
    force_error = state.force_error if with_errors else np.nan
    changes = readings.replicates / at_rest.replicates.mean(axis=0) - at_rest.replicates / at_rest.power
    light = standard_error(changes)
    mesh_error = np.zeros(len(light)) if readings.deviation is None else readings.deviation / at_rest.power
    step_error = state.memory.error if state.memory else 0.0
    return PressReading(force, force_error, changes.mean(axis=0), np.hypot(light, mesh_error), step_error)


def dataset(dim: str, rows: list[PressReading]) -> xr.Dataset:
    """Combine readings to a dataset over ``dim`` and ``taxel``."""
    forces, force_errors, changes, errors, step_errors = map(np.array, zip(*rows, strict=True))
    return xr.Dataset(
        {
            "force": (dim, forces, {"units": "N"}),
            "force_error": (dim, force_errors, {"units": "N"}),
            "change": ((dim, "taxel"), changes),
            "change_error": ((dim, "taxel"), errors),
            "step_error": (dim, step_errors),
        },
        coords={"taxel": np.arange(1, SIDE**2 + 1)},
    )


def centre_of(taxel: int) -> tuple[float, float]:
    """Position (x, y) of the centre of a taxel's cell, in mm."""
    row, column = divmod(taxel - 1, SIDE)
    return (column - SIDE // 2) * measured.PITCH, (SIDE // 2 - row) * measured.PITCH


def write_scene(file: Path, assumed: PadAssumptions = AS_FITTED, load: SceneLoad = INDENTER) -> None:
    """Write the scene of the pad under a load to a file; the folder is created if it does not exist."""
    board = -(assumed.collar + measured.PACKAGE_HEIGHT)
    around = measured.CORE + (SIDE - 1) * measured.PITCH
    values = {
        "side": SIDE,
        "pitch": measured.PITCH,
        "wall": (measured.PAD_SIDE - around) / 2,
        "core": measured.CORE,
        "free": measured.CORE_HEIGHT - assumed.collar,
        "poisson_ratio": assumed.poisson_ratio,
        "walls": _WALLS.format(walls=assumed.walls) if assumed.walls else "",
        "board": board,
        "reach": measured.PAD_SIDE / 2,
        "grid": _grid(board),
        "load": load.parameters,
        "defaults": load.defaults.format(friction=assumed.friction),
        "mesh_size": MESH_SIZE,
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as temporary:
        temporary.write_text(scene_text("measured_pad").format(**values), encoding="utf-8")


def _grid(bottom: float) -> str:
    """The bars of the grid between its windows, along x and along y, from the board up to z = 0, as XML."""
    centres = (np.arange(SIDE) - (SIDE - 1) / 2) * measured.PITCH
    edges = centres[:, None] + np.array([-0.5, 0.5]) * measured.WINDOW
    half = measured.PAD_SIDE / 2
    bars = []
    for low, high in np.concatenate([[-half], edges.ravel(), [half]]).reshape(-1, 2):
        width, length = ((high - low) / 2, (low + high) / 2), (half, 0.0)
        for x, y in ((width, length), (length, width)):
            size = f"{x[0]:g}, {y[0]:g}, {-bottom / 2:g}"
            bars.append(_BAR.format(size=size, centre=f"{x[1]:g}, {y[1]:g}, {bottom / 2:g}"))
    return "".join(bars)
