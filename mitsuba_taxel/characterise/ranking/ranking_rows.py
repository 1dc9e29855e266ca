"""A ranking of variants as text: rows of a table, and what explains its probabilities."""

from __future__ import annotations

from mitsuba_taxel.base.files.printed import Printed, figures_table
from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.ranking.comparison import DRAWS, Comparison
from mitsuba_taxel.characterise.wording import AS_SHOWN, as_word, figure_rows, with_error


def varied_names(found: Comparison) -> list[str]:
    """Columns in which the variants differ.

    Parameters
    ----------
    found : Comparison
        As :func:`compare` returns it.

    Returns
    -------
    list[str]
        Names of parameters.
    """
    names = list(found.table.columns)
    return names[1 : names.index(found.by)]


def comparison_rows(found: Comparison) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a comparison, as text."""
    table, where = found.table, varied_names(found)
    names = [name for name in table.columns if f"{name}_error" in table.columns]
    units = {**found.unit, "behind": found.unit[found.by]}
    scale = {name: prefixed(float(table[name].abs().max()), units[name]) for name in names}
    limited = bool((table.allowed < 1).any()) or len(names) > 2
    shown = [name for name in names if name != "behind"]
    headings = ["rank", *where, *(f"{name.replace('_', ' ')} [{scale[name][1]}]" for name in shown)]
    headings += [*(["allowed"] if limited else []), "first", f"behind [{scale['behind'][1]}]"]
    rows = []
    for record in table.to_dict("records"):
        cells = [str(record["rank"]) if found.ranked else "-", *(as_word(record[name]) for name in where)]
        numbers = {
            name: with_error(*(record[key] / scale[name][0] for key in (name, f"{name}_error"))) for name in names
        }
        cells += [numbers[name] for name in shown]
        cells += [f"{record['allowed']:.0%}"] if limited else []
        rows.append([*cells, f"{record['first']:.1%}", "-" if record["rank"] == 1 else numbers["behind"]])
    return headings, rows


def printed_comparison(found: Comparison) -> Printed:
    """A comparison as it is printed.

    Parameters
    ----------
    found : Comparison
        As :func:`compare` returns it.

    Returns
    -------
    Printed
        Tables and notes.
    """
    of = "" if found.volts is None else "readings in V"
    title = ", ".join(filter(None, (f"By {found.by.replace('_', ' ')}", of, found.channel)))
    shown: Printed = [figures_table(title, *comparison_rows(found)), *ranking_notes(found)]
    if found.volts is not None and len(found.volts):
        shown.append(figures_table(AS_SHOWN, *figure_rows(found.volts)))
    return [*shown, *found.notes]


def ranking_notes(found: Comparison) -> list[str]:
    """Lines that explain the columns of a comparison."""
    best = found.table["first"]
    lines = [
        "first: probability to be the best of those within the limits, in "
        f"{DRAWS} draws of all figures with their errors; behind: difference from the first, with its error."
    ]
    nobody = 1 - best.sum()
    if nobody > 0.5 / DRAWS:
        lines.append(f"In {nobody:.1%} of the draws no variant is within the limits.")
    if best.max() > best.iloc[0] and found.ranked:
        lines.append(
            "Ranks follow the figures themselves: a variant whose error is larger may be the best more often than one "
            "that ranks before it."
        )
    return lines
