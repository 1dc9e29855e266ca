"""`taxel compare`: ranking of variants, with probabilities."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..options import assignments, circuit_option, debug_option, json_option

if TYPE_CHECKING:
    from mitsuba_taxel.characterise import Comparison

FIGURES = (
    "max_slope", "mean_slope", "zero_slope", "relative_slope", "nonlinearity", "hysteresis", "repeatability",
)  # fmt: skip


@click.command(short_help="Variants ranked by a figure of merit, with probabilities.")
@click.argument("folders", metavar="DIR...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--by", type=click.Choice(FIGURES), default="relative_slope", show_default=True, help="Figure of merit.")
@click.option(
    "--at-most", multiple=True, metavar="FIGURE=LIMIT", callback=assignments,
    help="A limit that variants must meet, such as nonlinearity=3; in % for deviations, and for slopes in %/N and W/N "
    "or, with a circuit, V/N.",
)  # fmt: skip
@click.option("--force", metavar="NAME", help="Force along which to compare, if several are varied.")
@click.option("--up-to", type=click.FloatRange(min=0, min_open=True), metavar="N", help="Only forces up to N newtons.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="Also write the tables and a plot."
)
@circuit_option
@json_option
@debug_option
def command(
    folders: tuple[Path, ...],
    by: str,
    at_most: dict[str, str],
    force: str | None,
    up_to: float | None,
    output: Path | None,
    circuit: Path | None,
    as_json: bool,
) -> None:
    """Rank the variants in one or several studies: shapes, dimensions, or other parameters besides the force.

    The table gives the probability that a variant is the best of those that meet the limits. It also gives the
    difference of each variant from the first one; common random numbers make the error of this difference small. Slopes
    are ranked by magnitude. With a circuit (that of the studies, or --circuit), readings are in volts.

    If no variant meets the limits, none is ranked, and the exit code is 1.
    """
    from mitsuba_taxel import open_study
    from mitsuba_taxel.characterise import compare, printed_comparison
    from mitsuba_taxel.studies.plan.files import make_folder

    from ..tables import circuit_in, print_json, print_result, records, say

    limits = {name: _number(name, word) for name, word in at_most.items()}
    studies = {str(folder): open_study(folder) for folder in folders}
    comparison = compare(studies, by, limits, force=force, up_to=up_to, circuit=circuit_in(circuit))
    printed = printed_comparison(comparison)
    if output is not None:
        from mitsuba_taxel.base.files.atomic import replacing, write_text
        from mitsuba_taxel.base.files.printed import write_printed
        from mitsuba_taxel.plots.ranking import plot_ranking

        make_folder(output)
        with replacing(output / "comparison.csv") as file:
            comparison.table.to_csv(file, index=False)
        if comparison.volts is not None:
            with replacing(output / "volts.csv") as file:
                comparison.volts.to_csv(file, index=False)
        write_text(output / "notes.txt", "".join(f"{note}\n" for note in comparison.notes))
        write_printed(printed, output)
        with replacing(output / "comparison.png") as file:
            plot_ranking(comparison).savefig(file)
    if as_json:
        about = {"by": by, "units": comparison.unit, "channel": comparison.channel, "notes": comparison.notes}
        volts = {} if comparison.volts is None else {"volts": records(comparison.volts)}
        print_json({"variants": records(comparison.table), **about, **volts})
        _require_ranked(comparison)
        return
    print_result(printed)
    if output is not None:
        say(f"Results: {output}")
    _require_ranked(comparison)


def _require_ranked(comparison: Comparison) -> None:
    from mitsuba_taxel import ComputationError

    if not comparison.ranked:
        closest = comparison.table.iloc[0]
        limits = ", ".join(
            f"{name} at most {limit:g} {comparison.unit[name]}" for name, limit in comparison.limits.items()
        )
        raise ComputationError(
            f"no variant is within the limits ({limits}), so none is ranked: the first variant of the table meets "
            f"them with a probability of {closest.allowed:.1%}. Wider limits or other variants are needed."
        )


def _number(name: str, word: str) -> float:
    import math

    try:
        limit = float(word.removesuffix("%"))
    except ValueError:
        limit = math.nan
    if not limit >= 0 or limit == math.inf:
        raise click.BadParameter(f"{name}={word} is not allowed: a finite number of at least 0 is needed.")
    return limit
