"""`taxel fit`: unknowns of a scene from measured readings, and of a part from its curve over distance."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import on_a_study_file


@click.command(short_help="Unknowns of a scene, or of a part, from measured data.")
@click.option(
    "--part", metavar="NAME|FILE.toml",
    help="Fit this photo-reflector instead of a scene; the argument is then a CSV file of its current over distance.",
)  # fmt: skip
@click.option(
    "--zero", type=float, metavar="MM",
    help="With --part: height above the windows at which the distances in the CSV file begin.",
)  # fmt: skip
@on_a_study_file
def command(
    part: str | None,
    zero: float | None,
    source: Path,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Estimate the unknowns in the table [fit] of STUDY.toml, by weighted least squares.

    The data are a CSV file that is named in this table. It has columns for settings, such as fz, and for readings, such
    as v1_V. Values, confidence intervals, correlations, residuals and a plot are written to DIR. Unknowns that the data
    do not determine are reported.

    With --part, the properties of a photo-reflector are estimated instead: its dies, their depth, and the refractive
    index of the resin. The argument is then a CSV file with its current over distance. It has a column such as
    `distance [mm]` and one such as `current [mA]`. The result is written to part.toml in DIR, for `part` of a scene.
    """
    from ..tables import print_json, say

    if part is not None:
        _fit_part(source, part, zero or 0.0, folder, as_json)
        return
    if zero is not None:
        raise click.UsageError("--zero is not allowed without --part.")
    if source.suffix.lower() == ".csv":
        raise click.UsageError(f"{source} is a table, not a study: name the part that it was measured with by --part.")
    from mitsuba_taxel.fitting import run_fit

    result = run_fit(source, folder, workers=workers, scheduler=scheduler)
    if as_json:
        print_json({**_as_json(result), "output": str(folder)})
        return
    _show(result)
    say(f"Results: {folder}")


def _fit_part(curve: Path, part: str, zero: float, folder: Path, as_json: bool) -> None:
    from mitsuba_taxel.fitting import fit_part, write_part
    from mitsuba_taxel.fitting.part.written import interval_text, part_answer
    from mitsuba_taxel.plots.figures import save_figure
    from mitsuba_taxel.plots.part_fit import plot_part_fit
    from mitsuba_taxel.studies.plan.files import make_folder

    from ..tables import print_json, print_table, say

    fit = fit_part(curve, part, zero)
    make_folder(folder)
    write_part(fit, folder / "part.toml")
    save_figure(plot_part_fit(fit.part, fit.model), folder, "part")
    worst = float(abs(fit.model - fit.curve.currents).max())
    if as_json:
        unknowns = {
            u.name: {"value": u.value, "low": u.interval[0], "high": u.interval[1], "determined": u.determined}
            for u in fit.unknowns
        }
        print_json({"unknowns": unknowns, "rms": fit.rms, "worst": worst, "notes": fit.notes, "output": str(folder)})
        return
    say(f"{part_answer(fit)}\n")
    rows = ((unknown.name, f"{unknown.value:.4g}", interval_text(unknown)) for unknown in fit.unknowns)
    print_table(("unknown", "value", "95 % interval"), rows)
    say(
        f"{len(fit.curve.heights)} rows under a {fit.part.distance_reflector}; difference {fit.rms:.2%} of the largest "
        f"current (root mean square), at most {worst:.2%}. Intervals take these differences as noise."
    )
    for note in fit.notes:
        say(note)
    say(f"Results: {folder}")


def _as_json(result) -> dict[str, object]:
    from ..tables import known, records

    return {
        "unknowns": records(result.unknowns),
        "correlation": [[known(value) for value in row] for row in result.correlation.to_numpy().tolist()],
        "misfit": known(result.misfit),
        "warnings": result.warnings,
        "notes": result.notes,
    }


def _show(result) -> None:
    from mitsuba_taxel.fitting.wording import UNKNOWN_HEADINGS, fit_answer, unknown_rows

    from ..tables import print_notes, print_table, say

    say(f"{fit_answer(result.unknowns)}\n")
    print_table(UNKNOWN_HEADINGS, unknown_rows(result.unknowns))
    say("Errors: one standard deviation, of the data and of the model (light, finite elements, surfaces), and of both.")
    count, wide = len(result.residuals), int((result.residuals.in_errors.abs() > 2).sum())
    of = "" if result.misfit != result.misfit else f" Mean square of the residuals, in errors: {result.misfit:.3g}."
    say(f"{count} readings, {wide} of them more than two errors from the model.{of}")
    print_notes(result)
