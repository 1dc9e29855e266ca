"""Section of the page on the paper: its experiments, simulated and measured."""

from __future__ import annotations

from pathlib import Path

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.analysis import PUBLISHED, nonlinearity_of, table_one
from mitsuba_taxel.evidence.paper.comparison import pairs_in_order
from mitsuba_taxel.evidence.paper.page.words import Found


def experiments(studies: Found, pictures: Path) -> str:
    table = table_one(studies["nominal"])
    measured = {
        "normal": {cell: max(values) for cell, values in paper.MEASURED_NORMAL.items()},
        "tangential": {cell: max(values) for cell, values in paper.MEASURED_TANGENTIAL.items()},
    }
    rows = []
    for cell in paper.MEASURED_NORMAL:
        row = [cell]
        for kind, values in measured.items():
            slope, first = table[kind][cell], table[kind]["parallelepiped"]
            row.append(f"{values[cell] / values['parallelepiped']:.3f}")
            row.append(f"{slope.max_slope / first.max_slope:.3f}")
        percent = nonlinearity_of(studies["nominal"][cell]["fz"])
        rows.append([*row, f"{paper.MEASURED_NONLINEARITY[cell]:g}", with_error(*percent)])
    lines = []
    for kind, values in measured.items():
        for source, values_of in (
            ("this simulation", {cell: slope.max_slope for cell, slope in table[kind].items()}),
            ("the paper's simulation", PUBLISHED[kind]),
        ):
            in_order, pairs = pairs_in_order(values, values_of)
            agreeing = f"{in_order} of {pairs} pairs of shapes"
            lines.append(f"- {kind}: {agreeing} have the order of the experiments in {source}.")
    head = ["shape", "normal: measured", "here", "tangential: measured", "here", "e_nl measured [%]", "here [%]"]
    return f"""\
## The paper's experiments (Tables 2 to 4)
The shapes of cells are compared with the experiments by the order of their sensitivities:

{chr(10).join(lines)}

Only ratios and orders can be compared, but not values: the sensor of the experiments has 6 x 2 cells, so that forces
per cell differ.

The table has a row for each shape. It shows the sensitivity of the most sensitive taxel relative to that of the
parallelepiped (they were measured in V/N), and the nonlinearity e_nl (equation 7, from the end-point line up to 10 N):

{markdown_table(head, rows)}
"""
