"""Files of an optimisation: tables, plots, the best design as a scene and as drawings, and a page."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.base.files.printed import WARNING, Printed, PrintedTable, write_printed
from mitsuba_taxel.optimum.designs import pads_of
from mitsuba_taxel.optimum.plan import Design, Plan
from mitsuba_taxel.optimum.result import Optimum
from mitsuba_taxel.pads.parametric.drawings import write_drawings
from mitsuba_taxel.plots.figures import save_figure
from mitsuba_taxel.plots.optimum import plot_front, plot_optimum, plot_sections
from mitsuba_taxel.sensing import write_xml

if TYPE_CHECKING:
    import pandas

NEGLIGIBLE = 1e-5
"""Errors of figures below this, relative to the figures, are shown as 0."""
TABLES = ("figures", "variables", "slopes", "history", "front")


def write(plan: Plan, before: Design, best: Design, result: Optimum, folder: Path) -> None:
    """Write all files of a result.

    Parameters
    ----------
    plan : Plan
        The optimisation.
    before, best : Design
        The first and the best design.
    result : Optimum
        Comparison of the two designs.
    folder : Path
        Existing folder.
    """
    for name in TABLES:
        if len(table := getattr(result, name)):
            with replacing(folder / f"{name}.csv") as file:
                table.to_csv(file, index=False)
    save_figure(plot_optimum(result.figures, result.variables, result.history), folder, "optimum")
    if len(result.front):
        save_figure(plot_front(result.front, plan.front_units), folder, "front")
    scene = plan.scene(best.alone)
    write_xml(scene, folder / "best.xml")
    pads = [pads_of(drawn) for drawn in (plan.scene(before), scene)]
    for first, pad in zip(*pads, strict=True):
        write_drawings(pad, folder)
        save_figure(plot_sections(first, pad), folder, "section")
    write_text(folder / "optimum.md", page(result, bool(pads[0])))
    write_printed(printed_optimum(result), folder)


def page(result: Optimum, has_section: bool) -> str:
    """Format the result of an optimisation as a page in Markdown."""
    title = result.figures.figure[0]
    lines = [gain_line(result), slope_line(result), cost_line(result), *result.warnings, *result.notes]
    return "\n\n".join(
        [
            f"# {title[0].upper()}{title[1:]}",
            "\n".join(f"- {line}" for line in lines),
            "![Course, figures and variables before and after](optimum.png)",
            *(["![Section of the pad before and after](section.png)"] if has_section else []),
            markdown_table(["parameter", "before", "best", "bound"], changes(result)),
            as_markdown(result.figures),
            "## Around the best design\nChange of the worst components, per unit of a variable and over its bounds:",
            as_markdown(result.slopes),
            *(["## Trade-offs\n![Two objectives](front.png)", as_markdown(result.front)] if len(result.front) else []),
        ]
    )


def printed_optimum(result: Optimum) -> Printed:
    """Format the result of an optimisation for the terminal.

    Parameters
    ----------
    result : Optimum
        Result of :func:`optimise`.

    Returns
    -------
    Printed
        Tables and notes.
    """
    finer = "best_finer" in result.figures
    columns = ["before", "best", *(["before_finer", "best_finer"] if finer else [])]
    has_errors = bool(result.figures.error.notna().any())
    figures = [
        [
            row["figure"],
            row["unit"],
            *(shown(row[name]) for name in columns),
            *([_shown_error(row["error"], row["best"])] if has_errors else []),
            f"{row['multiplier']:.2g}" if row["multiplier"] > 0 else "",
        ]
        for row in result.figures.to_dict("records")
    ]
    named = [name.replace("_", ", ") for name in columns]
    headings = ["figure", "unit", *named, *(["error"] if has_errors else []), "binds"]
    return [
        gain_line(result),
        PrintedTable("", headings, figures),
        PrintedTable("", ["parameter", "before", "best", "bound"], [list(row) for row in changes(result)]),
        slope_line(result),
        cost_line(result),
        *(f"{WARNING}{line}" for line in result.warnings),
        *result.notes,
    ]


def changes(result: Optimum) -> list[tuple[str, str, str, str]]:
    """The parameters that the optimisation changed, as rows: name, value before, value of the best design, and active
    bound.
    """
    at = dict(zip(result.variables.variable, result.variables["at"], strict=True))
    pairs = ((name, result.before[name], word) for name, word in result.best.items())
    return [(name, old, f"{at_best(word)}", at.get(name, "")) for name, old, word in pairs if word != old]


def at_best(word: str) -> str:
    """Format the value of a parameter with enough digits for manufacturing."""
    try:
        return f"{float(word):.6g}"
    except ValueError:
        return word


def as_markdown(table: pandas.DataFrame) -> str:
    """Format a data frame as a table in Markdown."""
    rows = [[cell if isinstance(cell, str) else shown(cell) for cell in row] for row in table.to_numpy().tolist()]
    return markdown_table([name.replace("_", " ") for name in table], rows)


def _shown_error(error: float, value: float) -> str:
    """Text of an error, with two digits; ``0`` if it is too small to change the four digits of the figure."""
    return "" if math.isnan(error) else "0" if error < NEGLIGIBLE * abs(value) else f"{error:.2g}"


def shown(number: float) -> str:
    """Text of a number, with four digits; blank for NaN, which stands for a figure that a design does not have."""
    return "" if math.isnan(number) else f"{number:.4g}"


def gain_line(result: Optimum) -> str:
    """State the improvement by the best design, its error, and the probability of an improvement."""
    if result.gain_error != result.gain_error:
        return f"The objective improves by {result.gain:.1%}. Its error is not known."
    return (
        f"The objective improves by {result.gain:.1%} ± {result.gain_error:.1%}. The best design is better than the "
        f"first one with a probability of {result.probability:.4f}."
    )


def slope_line(result: Optimum) -> str:
    """State the remaining slope of the objective at the best design, and whether the design is a local optimum."""
    error = f" ± {result.unbalanced_error:.1%}" if result.gradients > 1 else ""
    verdict = "It is a local optimum" if result.is_local else "It is not shown to be a local optimum"
    count = f"{result.gradients} gradients" if result.gradients > 1 else "one gradient"
    return (
        f"{verdict}: the slope that remains within constraints and bounds would change the objective by "
        f"{result.unbalanced:.1%}{error} over the bounds (from {count})."
    )


def cost_line(result: Optimum) -> str:
    """State the cost of the optimisation in one line: seconds, and numbers of designs and load steps. The numbers may
    change with rounding errors.
    """
    return f"Seconds: jobs {result.seconds:.0f}, of {len(result.history)} designs with {result.load_steps} load steps"
