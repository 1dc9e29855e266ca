"""The paper's sensor, optimised for several purposes, compared with its four published shapes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import centre_of, scene_text
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.studies.plan.files import make_folder

MESH_SIZE = 1.6
"""Mesh size in mm of the designs; the best ones are verified on a finer mesh."""
LEAST_WALL = 0.8
"""Thinnest wall that the mould allows, in mm."""
LEAST_RADIUS = 0.3
"""Least radius of curvature of the roof of a square profile, in mm. Sharper tips need more patches for light without
random numbers than are allowed."""
PROFILE = "profile"
NOISE = 1e-6
"""One standard deviation of a reading, in W."""
HEIGHTS = {"parallelepiped": 1.55, "cylindrical": 1.55, "spherical": 1.6, "hemispheric": 1.775}
"""Heights of the paper's cells, in mm."""
LEAST_HEIGHT = {"hemispheric": 1.5}
LOWEST = 1.2
"""Least height of the roof of other cells above the board, in mm."""
PROFILE_HEIGHT = 2.4
"""Height in mm to which z of a profile is relative: the largest of all shapes."""
POINTS = {"r1": (1, 0.8, 1), "z1": (0.6458, 0.5, 1), "r2": (0.7071, 0.3, 0.95), "z2": (0.6458, 0.5, 1)}
POINTS["z3"] = POINTS["z1"]
"""Coordinates of the points of a profile from its rim to its crown, with their bounds; they begin as a flat roof."""
VARIABLES = {"cell_size": (2.2, 2.75), "height": (3.6, 5.5), "wall": (0.8, 1.6)}
TABLES = ("figures", "variables")

PURPOSES: dict[str, tuple[tuple[int, ...], str]] = {
    "normal": (
        (3, 5),
        'maximise = "sensitivity"\n[optimise.loads]\nnormal = { fz = [0, -10, -20] }\n'
        '[[optimise.constraints]]\nfigure = "nonlinearity"\nmost = 0.03\n',
    ),
    "tangential": ((3, 6), 'maximise = "sensitivity"\n[optimise.loads]\ntangential = { fz = -8, fx = [0, 4] }\n'),
    "resolution": (
        (1, 3, 7, 9),
        f'minimise = {{ figure = "resolution", noise = {NOISE} }}\n[optimise.loads]\nz = {{ fz = [0, -8] }}\n'
        "x = { fz = -8, fx = [0, 2] }\ny = { fz = -8, fy = [0, 2] }\n",
    ),
}
"""Taxels that are read, and optimisation problem, by the name of the purpose."""
SQUARE = f"square {PROFILE}"
"""A profile whose cells are square from above."""
PROFILES = (PROFILE, SQUARE)
LEANING = "leaning parallelepiped"
"""Parallelepiped cells whose tops may be shifted from their axes along x."""
MOST_LEAN = 0.5 * LEAST_WALL
"""Largest shift in mm of the tops of outer cells into the thinnest wall."""
MORE = {"normal": PROFILES, "tangential": (LEANING,)}
SHAPES = {name: (*paper.CELLS, *MORE.get(name, ())) for name in PURPOSES}
"""Shapes of cells that are optimised, by purpose."""
EFFORT = {("normal", SQUARE): (3, 20)}
"""Number of starts, and largest number of evaluations of each, where they differ from 1 and from :data:`EVALUATIONS`.
"""
EVALUATIONS = {"normal": 16, "tangential": 16, "resolution": 12}
RANGE = 20
"""Largest normal force in N up to which the best pads are followed."""
NEARLY = 0.01
"""Relative difference from the best design that counts as close to it."""

_REFLECTOR = """\
    <shape type="photo_reflector">
        <transform name="to_world"><translate value="{x}, {y}, 0"/></transform>
        <emitter type="annular_led"/> <sensor type="phototransistor"/>
    </shape>
"""
_STUDY = """\
scene = "sensor.xml"
mesh_size = {mesh_size}
[optimise]
starts = {starts}
evaluations = {evaluations}
{asked}
[[optimise.constraints]]
figure = "least_wall"
least = {least_wall}
{of_mould}[optimise.variables]
{variables}
"""
_OF_SQUARES = f"""\
[[optimise.constraints]]
figure = "least_radius"
least = {LEAST_RADIUS}
"""


def optima(store: PaperStudies, *, workers: int | None) -> dict[str, dict[str, xr.Dataset]]:
    """Compute the optimum for each purpose and cell shape."""
    return {
        purpose: {cell: _optimum(store, purpose, cell, workers) for cell in cells} for purpose, cells in SHAPES.items()
    }


def _optimum(store: PaperStudies, purpose: str, cell: str, workers: int | None) -> xr.Dataset:
    name = f"optimum/{purpose}_{cell}".replace(" ", "_")

    def compute() -> xr.Dataset:
        from mitsuba_taxel.optimum import optimise

        folder = store.folder / name
        write_study(folder, purpose, cell)
        return _dataset(optimise(folder / "study.toml", folder / "found", workers=workers))

    optimum = store.study(name, {"study": _study(purpose, cell), "taxels": list(PURPOSES[purpose][0])}, compute)
    reach = _reach(
        store, name, dict(zip(optimum.variables_variable.values, optimum.variables_best.values, strict=True))
    )
    return optimum.assign_attrs(reach.attrs)


def _reach(store: PaperStudies, name: str, values: Mapping[str, float]) -> xr.Dataset:
    """Compute the normal force in N, at most `RANGE`, up to which an optimised pad touches nothing, and the reason for
    this limit."""
    defines = {str(parameter): repr(float(value)) for parameter, value in values.items()}

    def compute() -> xr.Dataset:
        from mitsuba_taxel.sensing.derivatives.first_contact import first_contact

        def at(force: float) -> Scene:
            return Scene(store.folder / name / "sensor.xml", defines | {"fz": repr(float(force))}, MESH_SIZE)

        end = first_contact(at, "fz", -1.0, -RANGE)
        reason = f"it touches {end.touched}" if end.touched else end.ended
        return xr.Dataset(attrs={"reach": abs(end.value), "reach_ended": reason})

    return store.study(f"{name}_reach", defines, compute)


def _study(purpose: str, cell: str) -> str:
    roof = {"cell_height": (LEAST_HEIGHT.get(cell, LOWEST), PROFILE_HEIGHT)}
    if cell in PROFILES:
        roof = {name: (low, high) for name, (_, low, high) in POINTS.items()}
    if cell == LEANING:
        roof["top_x"] = (-MOST_LEAN, MOST_LEAN)
    starts, evaluations = EFFORT.get((purpose, cell), (1, EVALUATIONS[purpose]))
    return _STUDY.format(
        starts=starts,
        mesh_size=MESH_SIZE,
        evaluations=evaluations,
        asked=PURPOSES[purpose][1],
        least_wall=LEAST_WALL,
        of_mould=_OF_SQUARES if cell == SQUARE else "",
        variables="\n".join(f"{name} = [{low}, {high}]" for name, (low, high) in (roof | VARIABLES).items()),
    )


def write_study(folder: Path, purpose: str, cell: str) -> None:
    """Write the files of the scene and of the optimisation study for a purpose and a cell shape."""
    make_folder(folder)
    taxels = PURPOSES[purpose][0]
    reflectors = "".join(_REFLECTOR.format(x=x, y=y) for x, y in map(centre_of, taxels))
    cells = ", ".join(map(str, taxels))
    shape = cell.split()[-1]
    numbers = {name: start for name, (start, _, _) in POINTS.items()} if cell in PROFILES else {}
    section = "square" if cell == SQUARE else "round"
    attributes = f' <string name="section" value="{section}"/> <string name="profile" value="$r1 $z1; $r2 $z2; 0 $z3"/>'
    if cell == LEANING:
        numbers, attributes = {"top_x": 0}, ' <float name="top_x" value="$top_x"/>'
    scene = scene_text("optimised").format(
        shape=shape,
        cells=cells,
        cell_height=HEIGHTS.get(shape, PROFILE_HEIGHT),
        reflectors=reflectors,
        numbers="".join(f' <default name="{name}" value="{start}"/>' for name, start in numbers.items()),
        given=attributes if numbers else "",
    )
    for file, text in (("sensor.xml", scene), ("study.toml", _study(purpose, cell))):
        write_text(folder / file, text)


def _dataset(optimum: Any) -> xr.Dataset:
    """Convert an ``Optimum`` to a dataset: its tables become variables, and its numbers attributes."""
    variables = {}
    for name in TABLES:
        for column in getattr(optimum, name):
            values = getattr(optimum, name)[column].to_numpy()
            variables[f"{name}_{column}"] = (name, values if values.dtype.kind == "f" else values.astype(str))
    numbers = (
        "gain", "gain_error", "probability", "unbalanced", "unbalanced_error", "gradients", "beyond", "beyond_ended",
        "load_steps", "seconds",
    )  # fmt: skip
    attributes: dict[str, Any] = {name: float(getattr(optimum, name)) for name in numbers}
    messages = json.dumps([*optimum.warnings, *optimum.notes])
    failed = int(np.sum(optimum.history["failed"].notna())) if "failed" in optimum.history else 0
    attributes |= {"designs": len(optimum.history), "failed": failed, "said": messages}
    return xr.Dataset(variables | _descents(optimum), attrs=attributes)


def _descents(optimum: Any) -> dict[str, tuple[str, np.ndarray]]:
    """Summarise each descent of an ``Optimum``.

    The variables are the number of its designs, without initial designs; the number of failed designs; the seconds of
    all designs; the best allowed objective; and the number of designs until the objective was within 1 % of the best of
    all descents, NaN if it never was."""
    history, goal = optimum.history, optimum.figures.figure[0].split(" ", 1)[1]
    sign = -1 if optimum.figures.figure[0].startswith("maximise") else 1
    loss = sign * history[goal].where(history.allowed == True)  # noqa: E712  (others are missing)
    failed = history["failed"].notna() if "failed" in history else False
    close = loss <= loss.min() + NEARLY * abs(loss.min())
    rows = history.assign(loss=loss, failed=failed, close=close, seconds=optimum.design_seconds)[history.descent > 0]
    columns: dict[str, list[float]] = {"designs": [], "failed": [], "seconds": [], "best": [], "close": []}
    for _, group in rows.groupby("descent"):
        columns["designs"].append(len(group))
        columns["failed"].append(group.failed.sum())
        columns["seconds"].append(group.seconds.sum())
        columns["best"].append(sign * group.loss.min())
        columns["close"].append(1 + int(group.close.to_numpy().argmax()) if group.close.any() else np.nan)
    return {f"descent_{name}": ("descent", np.array(column, dtype=float)) for name, column in columns.items()}
