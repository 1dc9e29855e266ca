"""A ranking of variants as text: rows of a table, and notes that explain its probabilities."""

from __future__ import annotations

from mitsuba_taxel.base.files.printed import Printed, figures_table
from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.ranking.comparison import DRAWS, Comparison
from mitsuba_taxel.characterise.wording import AS_SHOWN, as_word, figure_rows, with_error


def varied_names(comparison: Comparison) -> list[str]:
    """Parameters in which the variants of a comparison differ.

    Parameters
    ----------
    comparison : Comparison
        Result of :func:`compare`.

    Returns
    -------
    list[str]
        Names of parameters.
    """
    names = list(comparison.table.columns)
    return names[1 : names.index(comparison.by)]


def comparison_rows(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Format the table of a comparison as headings and rows of text."""
    table, where = comparison.table, varied_names(comparison)
    names = [name for name in table.columns if f"{name}_error" in table.columns]
    units = {**comparison.unit, "behind": comparison.unit[comparison.by]}
    scale = {name: prefixed(float(table[name].abs().max()), units[name]) for name in names}
    limited = bool((table.allowed < 1).any()) or len(names) > 2
    shown = [name for name in names if name != "behind"]
    headings = ["rank", *where, *(f"{name.replace('_', ' ')} [{scale[name][1]}]" for name in shown)]
    headings += [*(["allowed"] if limited else []), "first", f"behind [{scale['behind'][1]}]"]
    rows = []
    for record in table.to_dict("records"):
        cells = [str(record["rank"]) if comparison.ranked else "-", *(as_word(record[name]) for name in where)]
        numbers = {
            name: with_error(*(record[key] / scale[name][0] for key in (name, f"{name}_error"))) for name in names
        }
        cells += [numbers[name] for name in shown]
        cells += [f"{record['allowed']:.0%}"] if limited else []
        rows.append([*cells, f"{record['first']:.1%}", "-" if record["rank"] == 1 else numbers["behind"]])
    return headings, rows


def printed_comparison(comparison: Comparison) -> Printed:
    """A comparison as tables and notes for the terminal.

    Parameters
    ----------
    comparison : Comparison
        Result of :func:`compare`.

    Returns
    -------
    Printed
        Tables and notes.
    """
    unit = "" if comparison.volts is None else "readings in V"
    title = ", ".join(filter(None, (f"By {comparison.by.replace('_', ' ')}", unit, comparison.channel)))
    ranks = figures_table(title, *comparison_rows(comparison))
    shown: Printed = [ranking_answer(comparison), ranks, *ranking_notes(comparison)]
    if comparison.volts is not None and len(comparison.volts):
        shown.append(figures_table(AS_SHOWN, *figure_rows(comparison.volts)))
    return [*shown, *comparison.notes]


def ranking_answer(comparison: Comparison) -> str:
    """A line that names the variant that ranks first, its figure and its probability of being the best one."""
    if not comparison.ranked:
        return "No variant ranks first: each is more likely to miss the limits than to meet them."
    best = comparison.table.iloc[0]
    factor, unit = prefixed(abs(float(best[comparison.by])), comparison.unit[comparison.by])
    where = ", ".join(f"{name} = {as_word(best[name])}" for name in varied_names(comparison))
    value = with_error(best[comparison.by] / factor, best[f"{comparison.by}_error"] / factor)
    figure = f"{comparison.by.replace('_', ' ')} {value} {unit}"
    return f"First: {where}, with {figure}. It is the best variant with a probability of {best['first']:.1%}."


def ranking_notes(comparison: Comparison) -> list[str]:
    """Lines that explain the columns of a comparison."""
    best = comparison.table["first"]
    lines = [
        "first: probability of being the best variant within the limits, in "
        f"{DRAWS} draws of all figures with their errors; behind: difference from the first variant, with its error."
    ]
    none_allowed = 1 - best.sum()
    if none_allowed > 0.5 / DRAWS:
        lines.append(f"In {none_allowed:.1%} of the draws no variant is within the limits.")
    if best.max() > best.iloc[0] and comparison.ranked:
        lines.append(
            "Variants rank by the value of their figure: a variant with a larger error may be the best more often than "
            "a variant that ranks before it."
        )
    return lines
