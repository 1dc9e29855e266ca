"""`taxel characterise`: figures of merit of a study or of a measurement."""

from __future__ import annotations

import os
from pathlib import Path

import click

from ..options import circuit_option, debug_option, json_option


@click.command(short_help="Sensitivity, nonlinearity, hysteresis, repeatability.")
@click.argument("source", type=click.Path(path_type=Path), metavar="DIR|FILE.csv")
@click.option(
    "-o", "--output", "folder", type=click.Path(path_type=Path), metavar="DIR",
    help="Folder for the results, instead of that of the study or file.",
)  # fmt: skip
@circuit_option
@json_option
@debug_option
def command(source: Path, folder: Path | None, circuit: Path | None, as_json: bool) -> None:
    """Compute sensitivity, nonlinearity, hysteresis and repeatability of the study in DIR, or of a bench measurement.

    FILE.csv has force and one voltage per taxel, and time where it was recorded, with headings such as
    time_s,force_N,v1_V,v2_V. Tables and plots
    are written beside it, or into DIR.
    """
    from mitsuba_taxel import open_study
    from mitsuba_taxel.base.errors import InputError
    from mitsuba_taxel.characterise import (
        characteristics,
        simulated_experiments,
        symmetric_pairs,
        volts_notes,
        volts_table,
    )
    from mitsuba_taxel.characterise.roles import force_parameters, forces_by_parameter
    from mitsuba_taxel.characterise.wording import remarks_explained
    from mitsuba_taxel.electronics.volts import circuit_of_study
    from mitsuba_taxel.plots.characteristics import write_characteristics
    from mitsuba_taxel.studies.plan.files import make_folder

    from ..tables import circuit_in, say

    measured = os.path.isfile(source) or (source.suffix.lower() == ".csv" and not os.path.isdir(source))
    if measured and circuit is not None:
        raise click.UsageError("--circuit is not allowed with a measurement, which is in volts.")
    volts, electronics = None, circuit_in(circuit)
    forces: list[str] = []
    named: dict[str, str] = {}
    if measured:
        experiments, deviations, maps, notes = _measured(source)
    else:
        study = open_study(source)
        forces, named = force_parameters(study), forces_by_parameter(study)
        electronics = electronics or circuit_of_study(study)
        experiments, deviations, maps, notes = simulated_experiments(study, electronics)
        volts = None if electronics is None else volts_table(study, electronics)
        notes += [] if volts is None else volts_notes(volts, electronics)
    if not experiments:
        needed = " or ".join(filter(None, (", ".join(forces[:-1]), *forces[-1:])))
        raise InputError(f"{source} holds no readings along a force: a study that varies {needed} is needed.")
    folder = folder or (source.parent if measured else source)
    make_folder(folder)
    table, pairs = characteristics(experiments, deviations), symmetric_pairs(maps)
    files = write_characteristics(folder, experiments, maps, table, pairs, volts)
    if as_json:
        _print_json(table, pairs, notes, files, volts)
        return
    _show(table, pairs, volts, named)
    for note in (*remarks_explained(table, pairs), *notes):
        say(note)
    say(f"Results: {', '.join(map(str, files))}")


def _measured(file: Path) -> tuple[list, dict, list, list[str]]:
    from mitsuba_taxel.characterise import read_measurement, recorded_experiment

    experiment = recorded_experiment(read_measurement(file))
    return [experiment], {}, [], list(experiment.notes)


def _print_json(table, pairs, notes: list[str], files: list[Path], volts) -> None:
    from ..tables import print_json, records

    print_json(
        {
            "characteristics": records(table),
            "symmetric_pairs": records(pairs),
            "notes": notes,
            "files": [str(file) for file in files],
        }
        | ({} if volts is None else {"volts": records(volts)})
    )


def _show(table, pairs, volts, named: dict[str, str]) -> None:
    from mitsuba_taxel.characterise.wording import merit_tables, pair_rows, slope_answers

    from ..tables import print_figures, say

    for line in slope_answers(table, named):
        say(f"{line}\n")
    titles = {**merit_tables(table, volts), "Symmetric pairs under a tangential load": pair_rows(pairs)}
    for title, (headings, rows) in titles.items():
        if rows:
            print_figures(title, headings, rows)
            say()
