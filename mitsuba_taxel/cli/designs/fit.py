"""`taxel fit`: unknowns of a scene from measured readings."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import on_a_study_file


@click.command(short_help="Unknowns of a scene from measured readings.")
@on_a_study_file
def command(source: Path, folder: Path, workers: int | None, scheduler: str | None, as_json: bool) -> None:
    """Estimate the unknowns in the table [fit] of STUDY.toml, by weighted least squares.

    Its data are a CSV file with columns for settings, such as fz, and readings, such as v1_V. Values, confidence
    intervals, correlations, residuals and a plot are written to DIR. Unknowns that the data do not determine are
    reported.
    """
    from mitsuba_taxel.fitting import run_fit

    from ..tables import print_json, say

    result = run_fit(source, folder, workers=workers, scheduler=scheduler)
    if as_json:
        print_json({**_as_json(result), "output": str(folder)})
        return
    _show(result)
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
