"""`taxel characterise`: figures of merit of a study or of a measurement."""

from __future__ import annotations

import os
from pathlib import Path

import click

from .options import debug_option, json_option


@click.command(short_help="Sensitivity, nonlinearity, hysteresis, repeatability.")
@click.argument("source", type=click.Path(path_type=Path), metavar="DIR|FILE.csv")
@click.option(
    "-o", "--output", "folder", type=click.Path(path_type=Path), metavar="DIR",
    help="Folder for the results, in place of the study's or the file's.",
)  # fmt: skip
@json_option
@debug_option
def command(source: Path, folder: Path | None, as_json: bool) -> None:
    """Characterise the study in DIR, or what a bench has measured.

    FILE.csv holds time, force and one voltage per taxel, under headings such as time_s,force_N,v1_V,v2_V. Tables and
    plots go beside it, or into DIR.
    """
    from mitsuba_taxel import open_study
    from mitsuba_taxel.base.errors import InputError
    from mitsuba_taxel.characterise import characteristics, simulated_experiments, symmetric_pairs
    from mitsuba_taxel.plots.characteristics import write_characteristics
    from mitsuba_taxel.studies.plan.files import make_folder

    measured = os.path.isfile(source) or (source.suffix.lower() == ".csv" and not os.path.isdir(source))
    experiments, off, maps, notes = _measured(source) if measured else simulated_experiments(open_study(source))
    if not experiments:
        raise InputError(f"{source} holds no readings along a force: a study that varies fx, fy or fz is needed.")
    folder = folder or (source.parent if measured else source)
    make_folder(folder)
    table, pairs = characteristics(experiments, off), symmetric_pairs(maps)
    files = write_characteristics(folder, experiments, maps, table, pairs)
    if as_json:
        click.echo(_as_json(table, pairs, notes, files))
        return
    _show(table, pairs)
    for note in notes:
        print(note)
    print(f"Results: {', '.join(map(str, files))}")


def _measured(file: Path) -> tuple[list, list, list, list[str]]:
    from mitsuba_taxel.characterise import read_measurement, recorded_experiment

    experiment = recorded_experiment(read_measurement(file))
    replicates = experiment.runs[0].samples.shape[1]
    error = "1 sigma of the recording's noise" if replicates > 1 else "not known (few rows, or correlated noise)"
    return [experiment], [], [], [f"{len(experiment.runs)} runs. Error: {error}."]


def _as_json(table, pairs, notes: list[str], files: list[Path]) -> str:
    import json

    def records(frame) -> list[dict]:
        return frame.astype(object).where(frame.notna(), None).to_dict("records")

    return json.dumps(
        {
            "characteristics": records(table),
            "symmetric_pairs": records(pairs),
            "notes": notes,
            "files": [str(file) for file in files],
        }
    )


def _show(table, pairs) -> None:
    from mitsuba_taxel.characterise.characteristics import DEVIATIONS, SLOPES
    from mitsuba_taxel.characterise.wording import pair_rows, table_rows

    from .tables import print_table

    titles = {
        "Sensitivities": table_rows(table, SLOPES),
        "Largest deviations, in percent of the largest change": table_rows(table, DEVIATIONS),
        "Symmetric pairs under a tangential load": pair_rows(pairs),
    }
    for title, (headings, rows) in titles.items():
        if rows:
            print(f"{title}:")
            print_table(headings, rows)
            print()
