"""Panels of the page's viewer: one for each combination of parameters of a study, with its load steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.report.page.light import LitScene
from mitsuba_taxel.report.page.solids import Packing, ShownSurface, Topologies, read_surfaces
from mitsuba_taxel.studies.plan.batch import Batch

MOST_PANELS = 6
"""Most load steps of a page: more would take minutes to write, and be slow to open."""
MOST_STEPS = 21


def viewer_panels(
    study: xr.Dataset,
    folder: Path,
    batch: Batch | None,
    most: int,
    left_out: list[str],
    progress: Callable[[int, int], None],
) -> list[dict[str, Any]]:
    """Panels of a study whose folder contains the meshes of its pads.

    Parameters
    ----------
    batch : Batch or None
        The scenes of the study, for light paths and packages; None leaves them out.
    most : int
        Largest number of panels, the first ones with a mesh.
    left_out : list of str
        Descriptions of what is not shown, and why, are added to it.
    progress : Callable[[int, int], None]
        Called with the number of load steps done and the number of all.
    """
    curve = study.attrs["curve"]
    others = [str(dim) for dim in study.mesh.dims if dim != curve]
    # Of a table of steps, a panel has the number of its row, and its scene the values there.
    given = [str(name) for name, values in study.mesh.coords.items() if values.dims and {*values.dims} <= {*others}]
    given = [name for name in given if name != "step"]
    stacked = study.mesh.stack(panel=others) if others else study.mesh.expand_dims("panel")
    filled = stacked.transpose("panel", curve).values != ""
    full = np.flatnonzero(filled.any(axis=1))
    if len(full) > most:
        left_out.append(f"{len(full) - most} of {len(full)} pads in three dimensions; their meshes are in the folder.")
    if np.any(filled[full[:most]].sum(axis=1) > MOST_STEPS):
        left_out.append(f"load steps in three dimensions, of which {MOST_STEPS} of each pad are drawn.")
    chosen = [(stacked.isel(panel=number), _selection(np.flatnonzero(filled[number]))) for number in full[:most]]
    total = sum(len(places) for _, places in chosen)
    panels: list[dict[str, Any]] = []
    for one, places in chosen:
        where = {name: _word(one[name].item()) for name in others}
        row = {name: _word(one[name].item()) for name in given}
        steps = [one.isel({curve: place}) for place in places]
        done = sum(len(panel["steps"]) for panel in panels)
        panels.append(
            _panel(where, row, steps, study, folder, batch, left_out, partial(_report, progress, done, total))
        )
    return panels


def _report(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)


def _selection(places: np.ndarray) -> np.ndarray:
    """A selection of many load steps, including both ends."""
    if len(places) <= MOST_STEPS:
        return places
    return places[np.linspace(0, len(places) - 1, MOST_STEPS).round().astype(int)]


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
    places = [topologies.place(surface) for surface in surfaces]
    rest = int(np.argmin([_size(step, along) for step in steps]))
    box = np.array([surfaces[rest].vertices.min(axis=0), surfaces[rest].vertices.max(axis=0)])
    most_pressure = max(float(surface.pressure.max()) for surface in surfaces)
    above = float(np.ptp(box, axis=0).max()) if most_pressure else 0.0  # what is shown of an indenter
    furthest = max(float(np.abs(surface.vertices).max()) for surface in surfaces)
    packing = Packing(1.1 * furthest + above)  # boards extend further
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
    moved = [_largest(surface, surfaces[rest]) for surface in surfaces]
    for number, (step, surface, place) in enumerate(zip(steps, surfaces, places, strict=True)):
        drawn = surface.vertices[topologies.coarse[place].kept]
        largest = moved[number]
        about = {"words": _words(step, along), "largest": None if largest is None else f"{largest:.3g}"}
        panel["steps"].append({**about, "topology": place, "vertices": packing.lengths(drawn)})
        if most_pressure:
            pressure = surface.pressure[topologies.coarse[place].kept]
            panel["steps"][-1]["pressure"] = packing.shares(pressure, most_pressure)
        if batch is not None:
            values = {**row, **{name: _word(step[name].item()) for name in along if name != "step"}}
            _light(panel, number, batch, values, box, packing, left_out)
        progress(number + 1)
    panel["most"] = float(f"{max(largest for largest in moved if largest is not None):.3g}")
    return panel


def _light(
    panel: dict[str, Any],
    number: int,
    batch: Batch,
    values: dict[str, str],
    box: np.ndarray,
    packing: Packing,
    left_out: list[str],
) -> None:
    """Add light and packages of a step's scene to a panel, or to ``left_out`` why there are none."""
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
    # The picture has room for the bodies of all steps.
    ends = np.array([panel["frame"], *([vertices.min(axis=0), vertices.max(axis=0)] for vertices, _ in bodies)])
    panel["frame"] = [ends[:, 0].min(axis=0).round(4).tolist(), ends[:, 1].max(axis=0).round(4).tolist()]
    if not panel["fixed"]:
        panel["fixed"] = lit.fixed(packing)
        panel["cut"] = round(100 * float((lit.y - box[0, 1]) / np.ptp(box[:, 1])))
        panel["taxel"] = lit.taxel
    if panel["steps"][number]["indenters"]:
        panel["cut"] = 0  # a body and the pad that it presses are seen whole


def _words(step: xr.DataArray, along: list[str]) -> str:
    parts = []
    for name in along:
        value, unit = step[name].item(), step[name].attrs.get("units", "")
        parts.append(f"{name} = {_word(value)} {unit}".strip())
    return ", ".join(parts)


def _word(value: str | float) -> str:
    """A value as in a scene: whole numbers have no decimal point."""
    return value if isinstance(value, str) else f"{value:.15g}"


def _size(step: xr.DataArray, along: list[str]) -> float:
    """Size of a load, to find the least one of a curve."""
    return sum(abs(step[name].item()) for name in along if not isinstance(step[name].item(), str))


def _largest(surface: ShownSurface, rest: ShownSurface) -> float | None:
    """Largest displacement between two states of a pad, in mm; None between different pads."""
    if not np.array_equal(surface.triangles, rest.triangles):
        return None
    return float(np.linalg.norm(surface.vertices - rest.vertices, axis=1).max())
