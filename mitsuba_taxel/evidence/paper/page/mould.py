"""The page of printed moulds: computed sensitivities of the experiments' pads, compared with measured ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.mould import (
    AS_DESIGNED,
    CELL,
    CHANGES,
    LAYERS,
    MESH_SIZE,
    PAD,
    POINTS,
    MouldFigures,
    MouldWalls,
    design,
    mould_figures,
    rest,
)
from mitsuba_taxel.evidence.paper.mould_rows import write_mould_rows
from mitsuba_taxel.evidence.paper.page.words import micro, paragraph
from mitsuba_taxel.plots.figures import COLOURS, MARKERS, panel_axes, save_small
from mitsuba_taxel.studies.plan.files import make_folder

Moulds = Mapping[MouldWalls, Mapping[str, xr.Dataset]]
Figures = Mapping[MouldWalls, MouldFigures]
Number = tuple[float, float]
"""A value and its error."""
FLAT = "parallelepiped"
ROUND = ("spherical", "hemispheric")
RELATIVE_TARGET, TARGET = 0.05, 3e-6
"""Target error of a slope, relative or in W/N."""
RESOLVED = 2.0
"""Least ratio of a resolved difference to its error."""
_HEAD = """\
# Printed moulds

For readers of the paper who ask what the steps of its printed moulds do to a sensor.

Written by `{command}`; do not edit by hand. Every number and every
comparison in the text comes from the runs.

"""
_INTRODUCTION = """\
In the paper's experiments, round cells (spherical and hemispheric) are four to five times less sensitive than flat ones
(parallelepiped), and less linear. In its simulation, all have sensitivities of the same order. The paper supposes that
the difference is due to the layer steps of printed moulds, and to walls that neither reflect nor absorb completely.
This page tests that supposition, one factor at a time."""
_ABOUT = """\
**Cases.** The reference is a smooth mould, white roofs (Lambertian, with an assumed reflectance of 0.9) and black sides
that absorb all light. One factor at a time is changed; some rows combine extremes. The layers of printed moulds are
stacked along z (upright) or x. A flat roof has no steps in an upright print, so that the smooth rows of flat cells are
valid for all layer heights.

**Loads.** All factors are computed for one cell, under a twelfth of the normal force of the experiments (0 to 10 N).
The factors with the largest effects are also computed for the pads of the experiments, with 6 x 2 cells, and there also
under 0 to 4 N along x or y at a normal force of 10 N. Forces are spread over the top. Pad and normal force are
symmetric about y = 0, so that only six of the twelve taxels are computed.

**Columns.** *Slopes* are mean slopes in µW per N on a whole pad, for 1 W per LED. They are positive where the reading
rises with compression. Whole pads have the slopes of the least and the most sensitive taxel; slopes of one cell are
divided by twelve. *Nonlinearity* (equation 7) and tangential slopes are those of the most sensitive taxel. A
nonlinearity below two errors is shown as "<" and the value plus two errors.

**Errors** are one standard deviation, due to light ({paths} paths for each reading; differences of readings use paths
through the same material points), finite elements of {mesh:g} mm, and triangles. {done} of {total} planned rows are
computed, and {more} of {others} other combinations for whole pads."""


def write_moulds(studies: Moulds, docs: Path, command: str) -> Path:
    """Write ``mould.md``, its figure ``mould/steps.png``, and its rows ``mould/rows.csv``; returns the page."""
    figures = {wall: mould_figures(paths, wall.share) for wall, paths in studies.items()}
    pictures = docs / "mould"
    make_folder(pictures)
    write_mould_rows(figures, pictures / "rows.csv")
    draw(figures, pictures / "steps.png")
    page = docs / "mould.md"
    write_text(page, page_of(figures, command))
    return page


def page_of(figures: Figures, command: str) -> str:
    """The page on printed moulds as Markdown, from figures of merit by pad."""
    designed, others = list(design()), list(rest())
    about = _ABOUT.format(
        mesh=MESH_SIZE,
        paths=32 * POINTS,
        done=sum(wall in figures for wall in designed),
        total=len(designed),
        more=sum(wall in figures for wall in others),
        others=len(others),
    )
    paragraphs = (paragraph(text.replace("\n", " ")) for text in about.split("\n\n"))
    parts = [_HEAD.format(command=command) + paragraph(_INTRODUCTION.replace("\n", " "))]
    parts.append("## Answers\n" + "\n".join(map(_bullet, judgement(figures))))
    parts.append("## Computed cases\n" + "\n\n".join(paragraphs))
    tables = {
        _OF_CELLS: _chosen(figures, CELL, changed=False),
        _OF_PADS: _chosen(figures, PAD, changed=False),
        _CHANGES: _chosen(figures, CELL, changed=True) | _chosen(figures, PAD, changed=True),
    }
    parts += [title + _computed(rows) for title, rows in tables.items() if rows]
    parts.append(_measured())
    parts += ["## Compared with the experiments\n" + _PICTURE, _ratios(figures)]
    if effects := list(_effects_of_steps(figures)):
        parts.append(_EFFECTS + markdown_table(list(effects[0]), [list(row.values()) for row in effects], WALL_HEADS))
    if missing := [wall for wall in designed if wall not in figures]:
        parts.append(paragraph("**Not computed**: " + "; ".join(map(_name, missing)) + "."))
    return "\n\n".join(parts) + "\n"


def _bullet(line: str) -> str:
    return paragraph(line, initial_indent="- ", subsequent_indent="  ")


WALL_HEADS = ("shape", "pad", "mould", "roof", "sides")
_EFFECTS = """\
The next table has the effect of steps. A row is the difference between a mould with steps and a smooth mould, with the
same roof and sides. *Change of slope* is that of the magnitude of the slope; *sensitivity* and *linearity* state the
direction if the change exceeds two errors. The errors of both moulds are assumed to be independent. The true errors are
rather smaller, because both have the same elements.

"""
_OF_CELLS = """\
## Walls of one cell
A row has the walls of a mould, and the slope and nonlinearity of one cell:

"""
_OF_PADS = """\
## Walls of whole pads
A row has the walls of a mould, and the slopes and nonlinearity of a pad:

"""
_CHANGES = """\
## Other explanations
The table has a row for each different assembly or load, with smooth moulds, white roofs and black sides. The last table
has the measured values. LEDs of different brightness need no row: they multiply all slopes of a taxel by the same
factor, and do not change the nonlinearity. Thin paint is a row in the tables above.

"""


def _chosen(figures: Figures, pad: str, changed: bool) -> dict[MouldWalls, MouldFigures]:
    """Select the computed pads for a table: those with the size ``pad``, such as 3 x 3, either with changed assembly
    (``changed``) or assembled as designed."""
    return {w: row for w, row in figures.items() if w.pad == pad and (w.change != AS_DESIGNED) == changed}


def _name(wall: MouldWalls) -> str:
    return f"{wall.cell}, {_setting_name(wall)}"


def _setting_name(wall: MouldWalls) -> str:
    words = (wall.pad, wall.mould, f"roof {wall.roof}", f"sides {wall.side:.0%}", wall.change)
    return ", ".join(word for word in words if word)


def _walls(wall: MouldWalls) -> tuple[str, str, str]:
    """First cells of a table row: mould, roof and sides of a pad."""
    return wall.mould, wall.roof, f"{wall.side:.0%}"


def _computed(figures: Figures) -> str:
    """Table of computed pads, as Markdown; columns without numbers are left out."""
    with_change = any(wall.change != AS_DESIGNED for wall in figures)
    what = ("pad", "assembly") if with_change else ("mould", "roof", "sides")
    columns = {"least": "least", "most": "most", "nonlinearity": "nonlinearity [%]", "along_x": "along x"}
    columns |= {"along_y": "along y"}
    if all(wall.pad == CELL for wall in figures):
        columns = {"most": "slope", "nonlinearity": "nonlinearity [%]"}
    rows = [
        (
            wall.cell,
            *((wall.pad, wall.change) if with_change else _walls(wall)),
            *(_bend(row.nonlinearity) if name == "nonlinearity" else micro(*row.numbers()[name]) for name in columns),
        )
        for wall, row in sorted(figures.items(), key=lambda item: _order(item[0]))
    ]
    head = ("shape", *what, *columns.values())
    return markdown_table(head, rows, head[: 1 + len(what)])


def _order(wall: MouldWalls) -> tuple[object, ...]:
    change = list(CHANGES).index(wall.change)
    return list(paper.MEASURED_NORMAL).index(wall.cell), wall.direction, wall.layer, wall.roof, wall.side, change


def _measured() -> str:
    head = ("measured, Tables 2 to 4", "least [mV/N]", "most [mV/N]", "nonlinearity [%]", "along x", "along y")
    rows = [
        (
            cell,
            *(f"{1e3 * value:.3g}" for value in paper.MEASURED_NORMAL[cell]),
            f"{paper.MEASURED_NONLINEARITY[cell]:g}",
            *(f"{1e3 * value:.3g}" for value in paper.MEASURED_TANGENTIAL[cell]),
        )
        for cell in paper.MEASURED_NORMAL
    ]
    return markdown_table(head, rows)


def reference(wall: MouldWalls) -> MouldWalls:
    """The pad to compare with: flat cells with equal roof, sides and assembly, from a smooth mould."""
    return replace(wall, cell=FLAT, layer=0.0, direction="")


def size(number: Number) -> Number:
    """Magnitude of a number with its error: a pair (value, error)."""
    return abs(number[0]), number[1]


def ratio(first: Number, second: Number) -> Number:
    """Ratio of two numbers with independent errors, as a magnitude with its error."""
    value = abs(first[0] / second[0])
    return value, math.hypot(first[1], value * second[1]) / abs(second[0])


def difference(first: Number, second: Number) -> Number:
    """Difference of two numbers with independent errors, with its error."""
    return first[0] - second[0], math.hypot(first[1], second[1])


def bound(number: Number) -> float:
    """Upper bound of a number with an error: its value plus `RESOLVED` errors."""
    return number[0] + RESOLVED * number[1]


def _bend(number: Number) -> str:
    """A nonlinearity in percent as text; "<" and its upper bound if it is not resolved."""
    value, error = number
    return with_error(value, error) if value > RESOLVED * error else f"< {bound(number):.2g}"


def _settings(figures: Figures) -> Iterator[tuple[MouldWalls, dict[str, MouldFigures]]]:
    """Figures of merit by cell shape, for each combination of walls that was computed for both round shapes and for
    flat cells."""
    for wall in figures:
        other, flat = replace(wall, cell=ROUND[1]), reference(wall)
        if wall.cell == ROUND[0] and other in figures and flat in figures:
            yield wall, {FLAT: figures[flat], ROUND[0]: figures[wall], ROUND[1]: figures[other]}


def misfit(row: Mapping[str, MouldFigures]) -> float:
    """Typical factor between computed and measured sensitivities of round cells, both relative to flat cells.

    Parameters
    ----------
    row : Mapping[str, MouldFigures]
        Figures by shape.

    Returns
    -------
    float
        Exponential of the root mean square of the logarithms of the ratios; 1 for perfect agreement.
    """
    logs = [math.log(ratio(row[cell].most, row[FLAT].most)[0] / measured_ratio(cell)) for cell in ROUND]
    return math.exp(math.sqrt(sum(log**2 for log in logs) / len(logs)))


def measured_ratio(cell: str) -> float:
    """Measured sensitivity of the most sensitive taxel of a shape, relative to that of flat cells (Table 2)."""
    return paper.MEASURED_NORMAL[cell][1] / paper.MEASURED_NORMAL[FLAT][1]


def _ratios(figures: Figures) -> str:
    head = ("walls", "spherical / flat", "hemispheric / flat", "misfit", "e_nl flat [%]", "spherical", "hemispheric")
    rows = []
    for wall, row in sorted(_settings(figures), key=lambda item: misfit(item[1])):
        sensitivities = (with_error(*ratio(row[cell].most, row[FLAT].most)) for cell in ROUND)
        bends = (_bend(row[cell].nonlinearity) for cell in (FLAT, *ROUND))
        rows.append((_setting_name(wall), *sensitivities, f"{misfit(row):.2f}", *bends))
    measured = (f"{measured_ratio(cell):.2f}" for cell in ROUND)
    bends = (f"{paper.MEASURED_NONLINEARITY[cell]:g}" for cell in (FLAT, *ROUND))
    rows.append(("measured", *measured, "", *bends))
    return paragraph(_RATIOS) + "\n\n" + markdown_table(head, rows)


_RATIOS = (
    "A row has the sensitivities of the most sensitive taxels, relative to those of flat cells with the same walls "
    "from a smooth mould, and the nonlinearity e_nl in percent. *Misfit* is the typical factor between the two "
    "computed ratios and the measured ratios. Rows are sorted by misfit:"
)


def judgement(figures: Figures) -> list[str]:
    """Sentences that compare the runs with the experiments and the paper's statements.

    Parameters
    ----------
    figures : Mapping[MouldWalls, MouldFigures]
        Figures of merit by walls.

    Returns
    -------
    list[str]
        Sentences on the statements for which rows have been computed.
    """
    return [
        *_statement_on_steps(figures),
        *_statement_on_shapes(figures),
        *_statement_on_linearity(figures),
        *_nearest(figures),
        *_other_explanations(figures),
        *_reached(figures),
    ]


def _nearest(figures: Figures) -> Iterator[str]:
    """Sentences on the walls whose computed ratios are nearest to the measured ratios, for whole pads and for one cell.
    """
    for pad in (PAD, CELL):
        settings = [(wall, row) for wall, row in _settings(figures) if wall.pad == pad]
        if not settings:
            continue
        wall, row = min(settings, key=lambda item: misfit(item[1]))
        left = " and ".join(
            f"{cell} cells have {with_error(*ratio(row[cell].most, row[FLAT].most))} of the sensitivity of flat cells "
            f"({measured_ratio(cell):.2f} measured)"
            for cell in ROUND
        )
        yield (
            f"Of {len(settings)} settings of {pad}, *{_setting_name(wall)}* is closest to the measured ratios of "
            f"sensitivities, with a misfit of {misfit(row):.2f}: {left}."
        )


def _pairs(figures: Figures) -> Iterator[tuple[MouldWalls, Number, Number]]:
    """Effect of the printed steps alone on pads with round cells: changes of sensitivity in W/N and of nonlinearity in
    percentage points."""
    for wall, row in sorted(figures.items(), key=lambda item: _order(item[0])):
        smooth = replace(wall, layer=0.0, direction="")
        if wall.layer and wall.cell in ROUND and smooth in figures:
            yield (
                wall,
                difference(size(row.most), size(figures[smooth].most)),
                difference(row.nonlinearity, figures[smooth].nonlinearity),
            )


def _effects_of_steps(figures: Figures) -> Iterator[dict[str, str]]:
    """Table of the effects of printed steps, from :func:`_pairs`, by heading."""
    for wall, slope, bend in _pairs(figures):
        yield {
            **dict(zip(WALL_HEADS, (wall.cell, wall.pad, *_walls(wall)), strict=True)),
            "change of slope": micro(*slope),
            "sensitivity": _direction(*slope, "more", "less"),
            "change of nonlinearity [points]": with_error(*bend),
            "linearity": _direction(*bend, "less", "more"),
        }


def _direction(value: float, error: float, above: str, below: str) -> str:
    return "not resolved" if abs(value) <= RESOLVED * error else above if value > 0 else below


def _statement_on_steps(figures: Figures) -> Iterator[str]:
    """Sentences on the paper's supposition that printed steps lower the sensitivity of round cells."""
    pairs = [(wall, slope) for wall, slope, _ in _pairs(figures)]
    if not pairs:
        return
    words = [_direction(*slope, "more", "less") for _, slope in pairs]
    partly = "holds in part" if "more" in words else "holds"
    holds = partly if "less" in words else "does not hold in this model"
    yield (
        f"**The paper: steps make round cells less sensitive.** This {holds}. Of {len(pairs)} rows with steps, "
        f"{words.count('less')} are less sensitive than the smooth mould and {words.count('more')} more sensitive, by "
        f"more than {RESOLVED:g} errors; the other differences are not resolved."
    )
    for cell in ROUND:
        factors = [
            f"{with_error(*ratio(figures[wall].most, figures[replace(wall, layer=0.0, direction='')].most))} "
            f"({wall.mould}, roof {wall.roof}, sides {wall.side:.0%})"
            for wall, _ in pairs
            if wall.pad == PAD and wall.cell == cell
        ]
        if factors:
            yield (
                f"On whole pads, steps multiply the sensitivity of {cell} cells by {' and '.join(factors)}. The "
                f"measured sensitivity is {measured_ratio(cell):.2f} of that of flat cells."
            )


def _statement_on_shapes(figures: Figures) -> Iterator[str]:
    """Sentences on whether flat cells are the most sensitive, under normal and under tangential forces."""
    settings = [row for wall, row in _settings(figures) if wall.pad == PAD]
    if not settings:
        return
    for cell in ROUND:
        values = [ratio(row[cell].most, row[FLAT].most)[0] for row in settings]
        spread = [ratio(row[cell].least, row[cell].most)[0] for row in settings]
        least, most = paper.MEASURED_NORMAL[cell]
        tangential = [ratio(row[cell].along_x, row[FLAT].along_x)[0] for row in settings]
        along_x = paper.MEASURED_TANGENTIAL[cell][0] / paper.MEASURED_TANGENTIAL[FLAT][0]
        yield (
            f"**The paper: flat cells are the most sensitive, up to one order.** On whole pads, {cell} cells have "
            f"{_range(values)} of their sensitivity to normal forces ({measured_ratio(cell):.2f} measured), and "
            f"{_range(tangential)} of that to forces along x ({along_x:.2f} measured). The least sensitive taxel has "
            f"{_range(spread)} of the sensitivity of the most sensitive taxel ({least / most:.2f} measured)."
        )


def _range(values: Iterable[float]) -> str:
    numbers = [value for value in values if not math.isnan(value)]
    return f"{min(numbers):.2f} to {max(numbers):.2f}" if numbers else "-"


def _statement_on_linearity(figures: Figures) -> Iterator[str]:
    """Sentences on whether the walls explain the measured nonlinearity."""
    for cell in (FLAT, *ROUND):
        whole = [row.nonlinearity for wall, row in figures.items() if wall.cell == cell and wall.pad == PAD]
        if not whole:
            continue
        most, bench = max(map(bound, whole)), paper.MEASURED_NONLINEARITY[cell]
        verdict = "so these walls do not explain it" if most < bench else "so these walls may explain it"
        yield (
            f"**The paper: real walls make {cell} cells nonlinear.** In {len(whole)} rows of whole pads, nonlinearity "
            f"is at most {most:.2g} % (value plus {RESOLVED:g} errors); {bench:g} % was measured, {verdict}."
        )


def _other_explanations(figures: Figures) -> Iterator[str]:
    """Sentences on whether a change of the assembly brings the computed ratios near the measured ratios."""
    settings = {
        wall.change: row
        for wall, row in _settings(figures)
        if wall.pad == CELL and wall == MouldWalls(wall.cell, change=wall.change, pad=CELL)
    }
    if len(settings) < 2:
        return
    values = {change: ratio(row[ROUND[0]].most, row[FLAT].most) for change, row in settings.items()}
    change = min(values, key=lambda word: values[word][0])
    lowest = values[change]
    verdict = "explain" if lowest[0] - RESOLVED * lowest[1] < measured_ratio(ROUND[0]) else "do not explain"
    yield (
        f"**Other explanations.** Of {len(settings)} assemblies of one cell, *{change or 'as designed'}* has the least "
        f"sensitive spherical cells, with {with_error(*lowest)} of the sensitivity of flat cells "
        f"({measured_ratio(ROUND[0]):.2f} measured). These changes {verdict} the low sensitivity of spherical cells."
    )
    signs = [row.most[0] for wall, row in figures.items() if wall.cell == ROUND[1] and wall.pad == CELL]
    if min(signs) < 0 < max(signs):
        yield (
            f"One hemispheric cell has slopes of both signs, from {1e6 * min(signs):.2g} to {1e6 * max(signs):.2g} "
            "µW/N. Small causes, such as the reflectance of the roof or the position of the package, multiply such "
            "small slopes, so that ratios of slopes mean little."
        )
    both = [
        ratio(row.most, figures[replace(wall, pad=CELL)].most)[0]
        for wall, row in figures.items()
        if wall.pad == PAD and wall.cell != ROUND[1] and replace(wall, pad=CELL) in figures
    ]
    if both:
        yield (
            f"One cell does not represent a pad: the most sensitive taxel of a pad with flat or spherical cells has "
            f"{_range(both)} times the slope of one cell with the same walls; hemispheric cells differ more."
        )


def _reached(figures: Figures) -> Iterator[str]:
    """A sentence with the number of slopes whose error is within the target."""
    slopes = [
        number
        for row in figures.values()
        for name, number in row.numbers().items()
        if name != "nonlinearity" and not math.isnan(number[0])
    ]
    within = sum(error <= max(RELATIVE_TARGET * abs(value), TARGET) for value, error in slopes)
    yield (
        f"{within} of {len(slopes)} slopes have an error of at most {RELATIVE_TARGET:.0%} or {1e6 * TARGET:g} µW/N. "
        "The reflectances are assumptions, the silicone is elastic, and the spread of boards and moulds is not "
        "modelled."
    )


_PICTURE = """\
![Sensitivity and nonlinearity against the height of layers](mould/steps.png)

*White roofs, black sides, layers along z; a height of 0 is a smooth mould. Lines: one cell. Open markers: whole pads,
slightly shifted. Bars: two standard errors. Dashed lines: measured values.*"""


def draw(figures: Figures, file: Path) -> None:
    """Draw sensitivities and nonlinearity against the height of layers along z, beside the measurements, as PNG."""
    sensitivity, bend = panel_axes(1, 2)[0]
    for number, cell in enumerate(ROUND):
        measured = {sensitivity: measured_ratio(cell), bend: paper.MEASURED_NONLINEARITY[cell]}
        for ax, value in measured.items():
            ax.axhline(value, color=COLOURS[number], linestyle="--", linewidth=1)
        for pad, shift in ((CELL, -0.002), (PAD, 0.002)):
            rows = [MouldWalls(cell, layer, "z" if layer else "", pad=pad) for layer in LAYERS]
            rows = [wall for wall in rows if wall in figures and reference(wall) in figures]
            shown = {
                sensitivity: [ratio(figures[wall].most, figures[reference(wall)].most) for wall in rows],
                bend: [figures[wall].nonlinearity for wall in rows],
            }
            style: dict[str, Any] = {"color": COLOURS[number], "marker": MARKERS[number], "capsize": 3}
            if pad == PAD:
                style |= {"linestyle": "", "markerfacecolor": "white"}
            at = [wall.layer + (2 * number - 1) * 0.002 + 2 * shift for wall in rows]
            for ax, values in shown.items():
                errors = [RESOLVED * error for _, error in values]
                ax.errorbar(at, [value for value, _ in values], errors, label=f"{cell}, {pad}", **style)
    sensitivity.set_ylabel("sensitivity / flat cells")
    bend.set_ylabel("nonlinearity [%]")
    bend.set_ylim(top=1.3 * max(paper.MEASURED_NONLINEARITY.values()))
    for ax in (sensitivity, bend):
        ax.set_xlabel("height of layers [mm]")
        ax.set_xticks(LAYERS)
        ax.set_ylim(bottom=0)
    sensitivity.legend(fontsize="small")
    save_small(sensitivity.figure, file)
