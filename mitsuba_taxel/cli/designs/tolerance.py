"""`taxel tolerance`: effect of tolerances on a sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..options import on_a_study_file, retry_option


@click.command(short_help="Spread of readings due to tolerances, and the share of each.")
@retry_option
@on_a_study_file
def command(
    source: Path, folder: Path, workers: int | None, scheduler: str | None, retry_failed: bool, as_json: bool
) -> None:
    """Compute how much readings vary because of tolerances: the distributions of parameters in [tolerance] of
    STUDY.toml.

    Tables and a plot show the spread of the reading at rest, of sensitivity and of cross-talk, and the share of the
    spread that each tolerance causes. Linear estimates of the spread, from derivatives, are given for comparison.

    Values of the parameters are drawn from the distributions. Each such sample is computed by mechanics and light, and
    stored in DIR as soon as it is ready. The same command resumes an interrupted run.

    With exact = N in the table, only N samples are computed in this way. All samples get a linear estimate from
    derivatives, which the N exact samples correct. A larger N continues a run.

    Tolerances are independent, except for factors in [tolerance.of], which scale several parameters: shrinkage = {law =
    "normal", mean = 1, sd = 0.003, scales = ["cell_size", "cell_height"]}.
    """
    from mitsuba_taxel.tolerances import run_tolerance

    from ..tables import print_json, say, study_bar

    with study_bar() as progress:
        result = run_tolerance(
            source, folder, workers=workers, scheduler=scheduler, retry_failed=retry_failed, progress=progress
        )
    if as_json:
        print_json({**_as_json(result), "notes": result.notes, "output": str(folder)})
        return
    _show(result)
    for note in result.notes:
        say(note)
    say(f"Results: {folder}")


def _as_json(result) -> dict[str, Any]:
    from ..tables import records

    tables = {"spread": result.spread, "shares": result.shares, "parameters": result.parameters}
    return {name: records(table) for name, table in tables.items()} | _counts(result)


def _counts(result) -> dict[str, int]:
    """Number of all samples and of exact samples, by name; empty if all samples are exact."""
    samples = result.samples
    return {"samples": len(samples), "exact": int(samples.exact.sum())} if "exact" in samples else {}


def _show(result) -> None:
    from mitsuba_taxel.tolerances.wording import (
        INDICES,
        SPREAD_HEADINGS,
        SPREADS,
        index_rows,
        spread_answer,
        spread_rows,
    )

    from ..tables import print_table, say

    counts = _counts(result)
    linear = ", all linear" if result.shares.rate.notna().any() else ""
    few = f", {counts['exact']} of them exact{linear}" if counts else ""
    say(f"{spread_answer(result.spread)}\n")
    say(f"{len(result.samples)} samples{few}; {SPREADS[0].lower()}{SPREADS[1:]}:")
    print_table(SPREAD_HEADINGS, spread_rows(result.spread))
    say(f"\n{INDICES}")
    print_table(*index_rows(result.parameters))
