"""The page of the best sensors for three purposes, compared with the paper's four shapes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.optima import (
    EFFORT,
    EVALUATIONS,
    HEIGHTS,
    LEAST_HEIGHT,
    LEAST_RADIUS,
    LEAST_WALL,
    LOWEST,
    MESH_SIZE,
    MOST_LEAN,
    NEARLY,
    NOISE,
    POINTS,
    PROFILE_HEIGHT,
    PROFILES,
    RANGE,
    VARIABLES,
)
from mitsuba_taxel.optimum.optimiser import NEAR
from mitsuba_taxel.optimum.search import BALANCED
from mitsuba_taxel.plots.figures import COLOURS, panel_axes, save_small
from mitsuba_taxel.studies.plan.files import make_folder

Optima = Mapping[str, Mapping[str, xr.Dataset]]

_HEAD = """\
# The paper's sensor optimised

For designers who ask how much better the paper's sensor can become.

Written by `{command}`; do not edit by hand. Every number and every comparison in the text comes from the runs.

The paper compares four shapes of cells, each with one set of dimensions. Here, [`taxel optimise`](theory/optimum.md)
searches for the dimensions of each shape that are best for a purpose. Each section begins with the best design. The
last sections explain the columns of the tables and the search.

![Before and after](optimum/optima.png)
"""
_ABOUT = """\
## Columns of the tables
A table has a row for each shape of cell. *Paper's* and *best* are the objective for the paper's design and for the best
design. The other columns are:

- **better by**: improvement by the best design, verified on a finer mesh than the {mesh_size:g} mm of the search; ± is
  the change of the improvement by the finer mesh.
- **remaining slope**: part of the objective's gradient that no active bound or constraint balances, as the relative
  change of the objective over the width of the bounds. Gradients scatter from mesh to mesh. The value is therefore the
  mean over the best design, the same design on the finer mesh, and the designs within {near:.0%} of it (in widths of
  the bounds); ± is its standard error.
- **optimum**: *yes* for a local optimum, whose remaining slope and its error together are at most {balanced:.0%}. For
  other designs, another descent was started on the finer mesh, and the column has its gain: *within* a value, rounded
  up, if the descent ended because its steps gained no more; a value *or more off* if it ended at its limit of designs.

## Search
Each search starts from the paper's dimensions: cells 2.55 mm wide and {heights} mm high, a pad 4.55 mm high, and walls
of 1 mm. Silicone, package and light are those of `pad.xml`; readings are in W for 1 W per LED.

One descent of at most {evaluations} designs was made for each shape, so that a better design elsewhere within the
bounds is not excluded. {effort}.

**Bounds.** The bounds are: cell_size {cell_size} mm, height of the pad {height} mm, outer wall {wall} mm, and
cell_height {lowest:g} (hemispheric {hemispheric:g}) to 2.4 mm. The mould allows walls of at least {least_wall:g} mm, so
that the cells are at most 2.75 mm wide at the paper's pitch.

**More shapes.** Three shapes are optimised in addition to the paper's four:

- A *profile* is a roof of revolution, whose meridian is a spline with three points. It has eight variables: the three
  dimensions above, r of the first two points (relative to half of cell_size, at least {r1:g} and {r2:g}), and z of all
  points ({lowest:g} to {profile_height:g} mm). The search starts from the paper's cylinder.
- A *square profile* has the same curve on four sides, like a pyramid. The search starts from the paper's
  parallelepiped. Its radii of curvature are at least {least_radius:g} mm, because light in sharper tips is not computed
  accurately.
- A *leaning parallelepiped* has tops that may lie up to {most_lean:g} mm off the axes of the cells along x, the
  direction of the force. All cells lean alike.
"""
TITLES = {
    "normal": "Most sensitive to normal force",
    "tangential": "Most sensitive to tangential force",
    "resolution": "Best resolution of all three components",
}
ASKED = {
    "normal": "Objective: mean slope up to -20 N of the less sensitive of taxels 3 (corner) and 5 (centre), with a "
    "nonlinearity of at most 3 %.",
    "tangential": "Objective: mean slope from 0 to 4 N along x, at -8 N, of the less sensitive of taxels 3 (corner) "
    "and 6 (side at +x).",
    "resolution": "Objective: the largest of the standard deviations of Fx, Fy and Fz if all three are estimated from "
    f"the four corner taxels, each with a noise of {1e6 * NOISE:g} µW. Slopes are means from 0 to 2 N along x and y at "
    "-8 N, and from 0 to -8 N along z.",
}
SCALES = {"normal": (1e6, "µW/N"), "tangential": (1e6, "µW/N"), "resolution": (1e3, "mN")}


def write_optima(optima: Optima, docs: Path, command: str) -> Path:
    """Write ``optimum.md`` and its picture; returns the page."""
    pictures = docs / "optimum"
    make_folder(pictures)
    _draw(optima, pictures / "optima.png")
    ranges = {name: f"{low:g} to {high:g}" for name, (low, high) in VARIABLES.items()}
    about = _ABOUT.format(
        **ranges,
        lowest=LOWEST,
        hemispheric=LEAST_HEIGHT["hemispheric"],
        least_wall=LEAST_WALL,
        least_radius=LEAST_RADIUS,
        heights=", ".join(f"{HEIGHTS[cell]:g}" for cell in paper.CELLS),
        mesh_size=MESH_SIZE,
        balanced=BALANCED,
        near=NEAR,
        most_lean=MOST_LEAN,
        r1=POINTS["r1"][1],
        r2=POINTS["r2"][1],
        profile_height=PROFILE_HEIGHT,
        evaluations=", ".join(f"{limit} ({purpose})" for purpose, limit in EVALUATIONS.items()),
        effort=". ".join(
            f"For the most sensitive {cell} to {purpose} force, {starts} descents of at most {limit} designs each were "
            "made, all but one from points of a Sobol' sequence"
            for (purpose, cell), (starts, limit) in EFFORT.items()
        ),
    )
    page = docs / "optimum.md"
    sections = [_section(name, shapes) for name, shapes in optima.items()]
    write_text(page, "\n".join([_HEAD.format(command=command), *sections, about, _cost(optima)]))
    return page


def _section(purpose: str, shapes: Mapping[str, xr.Dataset]) -> str:
    scale, unit = SCALES[purpose]
    names = ("cell_height", *VARIABLES)
    head, rows = ["shape", f"paper's [{unit}]", f"best [{unit}]", "better by", *names], []
    for cell, optimum in shapes.items():
        before, best = (scale * value for value in _goal(optimum))
        at = [
            f"{name} ({end})"
            for name, end in zip(_words(optimum, "variable"), _words(optimum, "at"), strict=True)
            if end
        ]
        values = _values(optimum)
        rows.append(
            [
                cell,
                f"{before:.3g}",
                f"{best:.3g}",
                f"{optimum.attrs['gain']:.0%} ± {optimum.attrs['gain_error']:.0%}",
                *(f"{values[name]:.3g}" if name in values else "" for name in names),
                ", ".join(at),
                _left(optimum),
                _optimal(optimum),
            ]
        )
    lines = [
        f"- {cell}: {line}"
        for cell, optimum in shapes.items()
        for line in (*_roof(optimum), *_lean(optimum), *json.loads(optimum.attrs["said"]))
    ]
    lines += [
        f"- {cell}: {_descents(purpose, cell, optimum)}"
        for cell, optimum in shapes.items()
        if optimum.sizes["descent"] > 1
    ]
    notes = "\n".join(lines) + "\n\n" if lines else ""
    table = markdown_table([*head, "active bounds", "remaining slope", "optimum"], rows)
    answer = f"{_best_of(purpose, shapes)}\n\n{ASKED[purpose]} {_reach_of(shapes)}"
    return f"## {TITLES[purpose]}\n{answer}\n\n{table}\n\n{notes}".rstrip() + "\n"


def _reach_of(shapes: Mapping[str, xr.Dataset]) -> str:
    """Sentences with the largest normal forces that the best pads bear without contact."""
    ends = [
        f"the {cell} one to {optimum.attrs['reach']:.3g} N ({optimum.attrs['reach_ended']})"
        for cell, optimum in shapes.items()
        if optimum.attrs["reach"] < RANGE
    ]
    sentence = f"Under normal force alone, the best pads touch nothing up to {RANGE} N, the range of the sensor"
    return f"{sentence}, but {', '.join(ends)}." if ends else f"{sentence}."


def _best_of(purpose: str, shapes: Mapping[str, xr.Dataset]) -> str:
    """Sentences that compare the best of the paper's shapes with the best of all shapes, for one purpose."""
    scale, unit = SCALES[purpose]
    sign = -1 if purpose == "resolution" else 1
    before = max(paper.CELLS, key=lambda cell: sign * _goal(shapes[cell])[0])
    best = max(shapes, key=lambda cell: sign * _goal(shapes[cell])[1])
    values = _goal(shapes[before])[0], _goal(shapes[best])[1]
    ratio = max(values) / min(values)
    nonlinear = ""
    if purpose == "normal":
        ratios = shapes[before].figures_before_finer.values[1], shapes[best].figures_best_finer.values[1]
        nonlinear = f", with a nonlinearity of {ratios[1]:.1%} instead of {ratios[0]:.1%}"
    return (
        f"The best of the paper's four designs is the {before}, with {scale * values[0]:.3g} {unit}. The best design "
        f"found is the {best}, with {scale * values[1]:.3g} {unit}: {ratio:.2f} times better{nonlinear}."
        f"{_profiles_of(shapes)}"
    )


def _profiles_of(shapes: Mapping[str, xr.Dataset]) -> str:
    """Sentences that compare optimised roof profiles with the paper's shapes, before and after their optimisation."""
    ends = [(cell, *_goal(shapes[cell])) for cell in paper.CELLS]
    (first, before, _), (second, _, after) = max(ends, key=lambda row: row[1]), max(ends, key=lambda row: row[2])
    best = {cell: _goal(shapes[cell])[1] for cell in PROFILES if cell in shapes}
    return "".join(
        f" The best {cell} is {value / before:.2f} times as sensitive as the paper's {first} cells, and "
        f"{value / after:.2f} times as sensitive as the best {second} cells."
        for cell, value in best.items()
    )


def _values(optimum: xr.Dataset) -> dict[str, float]:
    return dict(zip(_words(optimum, "variable"), optimum.variables_best.values.tolist(), strict=True))


def _roof(optimum: xr.Dataset) -> list[str]:
    """Text with the points of a roof profile."""
    values = _values(optimum)
    if "r1" not in values:
        return []
    points = [(values.get(f"r{k}", 0.0), values[f"z{k}"]) for k in (1, 2, 3)]
    shown = ", ".join(f"({0.5 * values['cell_size'] * r:.3g}, {PROFILE_HEIGHT * z:.3g})" for r, z in points)
    return [f"points (r, z) of the roof in mm, from the rim to the crown: {shown}"]


def _lean(optimum: xr.Dataset) -> list[str]:
    """Phrase with the distance by which the tops of the cells are shifted from their axes; empty for upright cells."""
    values = _values(optimum)
    if "top_x" not in values:
        return []
    lean = round(values["top_x"], 6)
    text = f"tops of cells lie {lean:.3g} mm off their axes along x; the outer wall is thinner there by this length"
    return [text if lean else "it does not lean, because the outer wall would be thinner by the same length"]


def _optimal(optimum: xr.Dataset) -> str:
    """Text on whether the design is a local optimum, or how much another descent may gain."""
    if optimum.attrs["unbalanced"] + optimum.attrs["unbalanced_error"] <= BALANCED:
        return "yes"
    if np.isnan(optimum.attrs["beyond"]):
        return "not shown"
    if optimum.attrs["beyond_ended"]:
        return f"within {math.ceil(1e3 * optimum.attrs['beyond']) / 1e3:.1%}"
    return f"{optimum.attrs['beyond']:.1%} or more off"


def _left(optimum: xr.Dataset) -> str:
    """Text with the remaining slope of the objective within the constraints, and its error if several gradients are
    known."""
    error = optimum.attrs["unbalanced_error"]
    return f"{optimum.attrs['unbalanced']:.1%}{f' ± {error:.1%}' if np.isfinite(error) else ''}"


def _descents(purpose: str, cell: str, optimum: xr.Dataset) -> str:
    """Text with the reason why each descent ended, and whether more evaluations could improve its result."""
    scale, unit = SCALES[purpose]
    _, limit = EFFORT[purpose, cell]
    columns = (optimum[f"descent_{name}"].values for name in ("best", "designs", "failed", "seconds", "close"))
    shown = []
    for best, count, failed, seconds, close in zip(*columns, strict=True):
        value = f"{scale * best:.3g} {unit}" if np.isfinite(best) else "no allowed design"
        ended = "as no more was allowed" if count >= limit else "as its steps gained no more"
        close_note = f", within {NEARLY:.0%} of the best of all after {close:.0f}" if np.isfinite(close) else ""
        shown.append(f"{value} ({count:.0f} designs in {seconds:.0f} s{close_note}, {failed:.0f} failed; {ended})")
    return f"its descents ended at {', '.join(shown)}"


def _goal(optimum: xr.Dataset) -> tuple[float, float]:
    """Objective before and after the optimisation, on the finer mesh if possible."""
    ends = (f"figures_{when}{'_finer' if 'figures_best_finer' in optimum else ''}" for when in ("before", "best"))
    before, best = (float(optimum[name].values[0]) for name in ends)
    return before, best


def _words(optimum: xr.Dataset, column: str) -> list[str]:
    return [str(word) for word in optimum[f"variables_{column}"].values.astype(str)]


def _cost(optima: Optima) -> str:
    all_optima = [optimum for shapes in optima.values() for optimum in shapes.values()]
    total = {
        name: sum(float(optimum.attrs[name]) for optimum in all_optima) for name in ("designs", "load_steps", "seconds")
    }
    head = ["purpose", "shape", "designs", "failed", "load steps", "s"]
    names = ("designs", "failed", "load_steps", "seconds")
    rows = [
        [purpose, cell, *(f"{float(optimum.attrs[name]):.0f}" for name in names)]
        for purpose, shapes in optima.items()
        for cell, optimum in shapes.items()
    ]
    return (
        f"## Cost\n{total['designs']:.0f} designs with {total['load_steps']:.0f} load steps took "
        f"{total['seconds'] / 60:.0f} minutes, summed over processes, without the verification of the best ones.\n\n"
        f"{markdown_table(head, rows)}\n"
    )


def _draw(optima: Optima, file: Path) -> None:
    axes = panel_axes(1, len(optima), size=(3.6, 3.0), sharex=False)
    for ax, (purpose, shapes) in zip(axes[0], optima.items(), strict=True):
        _draw_bars(ax, purpose, shapes)
    axes[0, 0].legend(fontsize="small")
    save_small(axes[0, 0].figure, file)


def _draw_bars(ax: Any, purpose: str, shapes: Mapping[str, xr.Dataset]) -> None:
    scale, unit = SCALES[purpose]
    goals, positions = scale * np.array([_goal(optimum) for optimum in shapes.values()]), np.arange(len(shapes))
    for shift, values, label, colour in ((-0.2, goals[:, 0], "paper", 7), (0.2, goals[:, 1], "best", 1)):
        ax.bar(positions + shift, values, 0.4, label=label, color=COLOURS[colour])
    ax.set_xticks(positions, [_short(cell) for cell in shapes], fontsize="small")
    ax.set_title(TITLES[purpose], fontsize="small")
    ax.set_ylabel(f"[{unit}]")


def _short(cell: str) -> str:
    """Short name of a cell shape for tables, such as ``parall.`` and ``square / profile``."""
    return "\n".join(word if len(word) < 8 else f"{word[:6]}." for word in cell.split())
