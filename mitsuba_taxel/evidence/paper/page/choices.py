"""Section of the page on the paper: effect of the choices that the paper leaves open."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import figures, paper, plate
from mitsuba_taxel.evidence.paper.analysis import PUBLISHED, against_table_one, least, table_one
from mitsuba_taxel.evidence.paper.comparison import CommonFactorFit, pairs_in_order
from mitsuba_taxel.evidence.paper.page.words import Found, paragraph, steepest
from mitsuba_taxel.evidence.paper.slopes import Sensitivity
from mitsuba_taxel.evidence.paper.variations import NOMINAL, NOMINAL_LAW, NOMINAL_SPACING, choices

NEAR_THE_DATASHEET = 0.03
"""Largest distance in mm of a peak from the datasheet's to count as consistent."""


def variations(studies: Found, pictures: Path) -> str:
    tables = {words: table_one(cells) for words, cells in studies["variations"].items()}
    fits = {words: against_table_one(table) for words, table in tables.items()}
    figures.choices(tables, pictures / "choices.png")
    heights = _heights(studies)
    columns = [(kind, cell) for kind in PUBLISHED for cell in paper.CELLS]
    head = [
        "choice",
        *(f"{cell[:4]}. {kind[0].upper()}" for kind, cell in columns),
        "order",
        "factor",
        "misfit",
        "peak",
    ]
    rows = []
    for words, table in tables.items():
        slopes = [steepest(table[kind][cell]) for kind, cell in columns]
        orders = [pairs_in_order({c: s.max_slope for c, s in table[k].items()}, PUBLISHED[k]) for k in PUBLISHED]
        order_counts = "+".join(str(count) for count, _ in orders)
        rows.append(
            [
                words,
                *slopes,
                order_counts,
                f"{fits[words].scale:.3g}",
                f"{fits[words].misfit:.2f}",
                _height(heights[words]),
            ]
        )
    return f"""\
## Effects of unstated choices on Table 1
![Sensitivities under each choice](paper/choices.png)

The paper does not state some choices that its simulation made. This section changes these choices of the nominal
sensor, one or two at a time. {_computed(tables)}

{_unexplained(tables, fits, heights)}

{paragraph(_influence(tables))}

**All results.** A row of the table has the sensor with one changed choice, or with two. The columns are:

- *N* and *T*: sensitivities of the four shapes in µW/N, under normal forces up to 20 N (*N*), and under tangential
  forces up to 8 N along x or y at a normal force of -8 N (*T*).
- *order*: number of pairs of shapes that are in the paper's order: of the 6 pairs under normal force, plus of the 6
  pairs under tangential force.
- *factor*: common factor that brings the slopes closest to the paper's numbers (the power of the source in W).
- *misfit*: typical ratio between the slopes, multiplied by this factor, and the paper's numbers.
- *peak*: height in mm of a mirror plate at which the reading is largest.

{markdown_table(head, rows)}

A sensitivity in this table is the steepest slope of two taxels, the corner and the centre; Table 1 has the steepest of
all nine. The elements are those used for the normal forces of Table 1. Slopes are those of curves through readings and
their derivatives at 0, 10 and 20 N, and at 0, 4 and 8 N. With mirrors, which need random paths, slopes are differences
between these forces, and their noise may exceed the slope.

No choice turns the packages by 90 degrees. This only exchanges x and y, and the tangential slopes of Table 1 are the
larger of those along x and y.
"""


def _computed(tables: Mapping[str, Any]) -> str:
    """Sentences with the number of choices that are computed, and the names of those that are not."""
    names = [choice.words for choice in choices() if choice.words not in tables]
    missing = f" Not computed: {'; '.join(names)}." if names else ""
    return paragraph(f"{len(tables)} of {len(choices())} choices and pairs are computed.{missing}")


def _heights(studies: Found) -> dict[str, plate.CurveMaximum]:
    """Height of the peak for die spacing and law of each choice; NaN if unknown."""
    peaks = plate.peaks(studies["peak"]) if "peak" in studies else {}

    def height(values: Mapping[str, Any]) -> plate.CurveMaximum:
        if not peaks or {"hole", "detector_width", "body_reflectance"} & set(values):
            return plate.CurveMaximum(math.nan, math.nan)
        return peaks[values.get("law", NOMINAL_LAW)][values.get("spacing", NOMINAL_SPACING)]

    return {choice.words: height(choice.values) for choice in choices()}


def _height(peak: plate.CurveMaximum) -> str:
    return with_error(*peak) if math.isfinite(peak.at) else "-"


def _influence(tables: Mapping[str, Mapping[str, Mapping[str, Sensitivity]]]) -> str:
    """Sentences that rank the single choices by their effect on the eight slopes."""
    nominal = tables[NOMINAL]

    def typical_factor(words: str) -> float:
        logs = [
            math.log(least(tables[words][kind][cell]) / least(nominal[kind][cell]))
            for kind in PUBLISHED
            for cell in paper.CELLS
        ]
        return math.exp(math.sqrt(float(np.mean(np.square(logs)))))

    single = [choice.words for choice in choices() if choice.single and choice.words in tables]
    ranked = sorted(single, key=typical_factor, reverse=True)
    listed = ", ".join(f"{words} ({typical_factor(words):.2f})" for words in ranked)
    return f"**Single choices**, with the typical factor by which they change a slope: {listed}."


def _unexplained(
    tables: Mapping[str, Any], fits: Mapping[str, CommonFactorFit], heights: Mapping[str, plate.CurveMaximum]
) -> str:
    """Sentences on the choices that fit best: the remaining ratio of each published number to its fit."""
    consistent = [words for words in tables if abs(heights[words].at - paper.PEAK_HEIGHT) <= NEAR_THE_DATASHEET]
    groups = {"Of all choices": tables, "Of the choices with a peak within 0.03 mm of the datasheet's": consistent}
    lines = []
    for group, names in groups.items():
        if names:
            best = min(names, key=lambda words: fits[words].misfit)
            simulated = {(kind, cell): slope for kind in PUBLISHED for cell, slope in tables[best][kind].items()}
            ratios = ", ".join(
                f"{cell} {kind} {PUBLISHED[kind][cell] / (fits[best].scale * least(slope)):.2f}"
                for (kind, cell), slope in simulated.items()
            )
            lines.append(
                f"- {group}, *{best}* has the least misfit, {fits[best].misfit:.2f}, with a factor of "
                f"{fits[best].scale:.3g}. The paper's numbers, divided by the slopes times this factor: {ratios}."
            )
    return "**Best choices, and the remaining differences**\n\n" + "\n".join(lines)
