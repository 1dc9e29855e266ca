"""Panels of the page's 3D viewer: one for each combination of parameters of a study, with its load steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.report.page.light import LitScene
from mitsuba_taxel.report.page.solids import ArrayEncoding, ShownSurface, Topologies, read_surfaces
from mitsuba_taxel.studies.plan.batch import Batch

MOST_PANELS = 6
"""Largest number of load steps of a page: with more, writing would take minutes, and the page would open slowly."""
MOST_STEPS = 21


def viewer_panels(
    study: xr.Dataset,
    folder: Path,
    batch: Batch | None,
    most: int,
    left_out: list[str],
    progress: Callable[[int, int], None],
) -> list[dict[str, Any]]:
    """Data for the panels of the 3D viewer, from the meshes of the pads in the folder of a study.

    Parameters
    ----------
    batch : Batch or None
        The scenes of the study, for light paths and packages; None omits these.
    most : int
        Largest number of panels; the first with a mesh are shown.
    left_out : list[str]
        List to which reasons are added for everything that is not shown.
    progress : Callable[[int, int], None]
        Called with (load steps done, total load steps).
    """
    curve = study.attrs["curve"]
    fixed = [str(dim) for dim in study.mesh.dims if dim != curve]
    # The title of a panel of a table of steps is the number of its row; its scene has the values of that row.
    row_names = [str(name) for name, values in study.mesh.coords.items() if values.dims and {*values.dims} <= {*fixed}]
    row_names = [name for name in row_names if name != "step"]
    stacked = study.mesh.stack(panel=fixed) if fixed else study.mesh.expand_dims("panel")
    filled = stacked.transpose("panel", curve).values != ""
    full = np.flatnonzero(filled.any(axis=1))
    if len(full) > most:
        left_out.append(f"{len(full) - most} of {len(full)} pads in three dimensions; their meshes are in the folder.")
    if np.any(filled[full[:most]].sum(axis=1) > MOST_STEPS):
        left_out.append(f"load steps in three dimensions, of which {MOST_STEPS} of each pad are drawn.")
    chosen = [(stacked.isel(panel=number), _selection(np.flatnonzero(filled[number]))) for number in full[:most]]
    total = sum(len(indices) for _, indices in chosen)
    panels: list[dict[str, Any]] = []
    for curve_study, indices in chosen:
        where = {name: _word(curve_study[name].item()) for name in fixed}
        row = {name: _word(curve_study[name].item()) for name in row_names}
        steps = [curve_study.isel({curve: index}) for index in indices]
        done = sum(len(panel["steps"]) for panel in panels)
        panels.append(
            _panel(where, row, steps, study, folder, batch, left_out, partial(_report, progress, done, total))
        )
    return panels


def _report(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)


def _selection(indices: np.ndarray) -> np.ndarray:
    """Indices of the load steps that are shown: at most `MOST_STEPS`, spread evenly, with the first and the last."""
    if len(indices) <= MOST_STEPS:
        return indices
    return indices[np.linspace(0, len(indices) - 1, MOST_STEPS).round().astype(int)]


def _panel(
    where: dict[str, str],
    row: dict[str, str],
    steps: list[xr.DataArray],
    study: xr.Dataset,
    folder: Path,
    batch: Batch | None,
    left_out: list[str],
    progress: Callable[[int], None],
) -> dict[str, Any]:
    along = [str(name) for name, values in study.coords.items() if values.dims == (study.attrs["curve"],)]
    along = [name for name in along if name != "step" or len(along) == 1]
    topologies = Topologies()
    surfaces = [read_surfaces([folder / file for file in step.item().split()]) for step in steps]
    placements = [topologies.place(surface) for surface in surfaces]
    rest = int(np.argmin([_size(step, along) for step in steps]))
    box = np.array([surfaces[rest].vertices.min(axis=0), surfaces[rest].vertices.max(axis=0)])
    most_pressure = max(float(surface.pressure.max()) for surface in surfaces)
    above = float(np.ptp(box, axis=0).max()) if most_pressure else 0.0  # shown part of an indenter
    furthest = max(float(np.abs(surface.vertices).max()) for surface in surfaces)
    packing = ArrayEncoding(1.1 * furthest + above)  # boards extend further
    panel: dict[str, Any] = {
        "unit": packing.unit,
        "name": ", ".join(f"{name} = {value}" for name, value in where.items()),
        "box": box.round(4).tolist(),
        "frame": box.round(4).tolist(),
        "rest": rest,
        "topologies": [packing.topology(coarse) for coarse in topologies.coarse],
        "steps": [],
        "fixed": [],
        "cut": 50,
        "taxel": None,
        "pressure": float(f"{most_pressure:.3g}"),
    }
    largest_displacement = [_largest(surface, surfaces[rest]) for surface in surfaces]
    for number, (step, surface, placement) in enumerate(zip(steps, surfaces, placements, strict=True)):
        drawn = surface.vertices[topologies.coarse[placement].kept]
        largest = largest_displacement[number]
        about = {"words": _words(step, along), "largest": None if largest is None else f"{largest:.3g}"}
        panel["steps"].append({**about, "topology": placement, "vertices": packing.lengths(drawn)})
        if most_pressure:
            pressure = surface.pressure[topologies.coarse[placement].kept]
            panel["steps"][-1]["pressure"] = packing.shares(pressure, most_pressure)
        if batch is not None:
            values = {**row, **{name: _word(step[name].item()) for name in along if name != "step"}}
            _light(panel, number, batch, values, box, packing, left_out)
        progress(number + 1)
    panel["most"] = float(f"{max(largest for largest in largest_displacement if largest is not None):.3g}")
    return panel


def _light(
    panel: dict[str, Any],
    number: int,
    batch: Batch,
    values: dict[str, str],
    box: np.ndarray,
    packing: ArrayEncoding,
    left_out: list[str],
) -> None:
    """Add light and packages of a step's scene to a panel, or the reason why there are none to ``left_out``."""
    try:
        lit = LitScene(batch.scene(values).load(), box)
        panel["steps"][number]["rays"] = lit.paths(packing)
        bodies = lit.indenters()
    except (InputError, ComputationError) as error:
        line = f"light paths: {error}"
        left_out += [line] if line not in left_out else []
        return
    panel["steps"][number]["indenters"] = [
        {"vertices": packing.lengths(vertices), "triangles": packing.indices(triangles)}
        for vertices, triangles in bodies
    ]
    # The picture contains the indenters of all steps.
    ends = np.array([panel["frame"], *([vertices.min(axis=0), vertices.max(axis=0)] for vertices, _ in bodies)])
    panel["frame"] = [ends[:, 0].min(axis=0).round(4).tolist(), ends[:, 1].max(axis=0).round(4).tolist()]
    if not panel["fixed"]:
        panel["fixed"] = lit.fixed(packing)
        panel["cut"] = round(100 * float((lit.y - box[0, 1]) / np.ptp(box[:, 1])))
        panel["taxel"] = lit.taxel
    if panel["steps"][number]["indenters"]:
        panel["cut"] = 0  # the picture contains a whole indenter and the whole pad that it presses


def _words(step: xr.DataArray, along: list[str]) -> str:
    phrases = []
    for name in along:
        value, unit = step[name].item(), step[name].attrs.get("units", "")
        phrases.append(f"{name} = {_word(value)} {unit}".strip())
    return ", ".join(phrases)


def _word(value: str | float) -> str:
    """Text of a value, in the form that scenes have: whole numbers without a decimal point."""
    return value if isinstance(value, str) else f"{value:.15g}"


def _size(step: xr.DataArray, along: list[str]) -> float:
    """Magnitude of the load of a step, with which the step of least load of a curve is found."""
    return sum(abs(step[name].item()) for name in along if not isinstance(step[name].item(), str))


def _largest(surface: ShownSurface, rest: ShownSurface) -> float | None:
    """Largest displacement in mm between two states of a pad; None if the surfaces belong to different pads."""
    if not np.array_equal(surface.triangles, rest.triangles):
        return None
    return float(np.linalg.norm(surface.vertices - rest.vertices, axis=1).max())
