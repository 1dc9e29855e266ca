"""`taxel sweep`: a scene over values of its parameters, or a study file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..options import (
    assignments,
    circuit_option,
    debug_option,
    defines_option,
    derivatives_option,
    folder_option,
    json_option,
    points_option,
    retry_option,
    scheduler_option,
    seed_option,
    target_error_option,
    target_slope_option,
    time_budget_option,
    workers_option,
)

OF_A_SCENE = (
    "vary", "together", "steps", "defines", "target_error", "points", "time_budget", "seed", "maps", "derivatives",
    "target_slope", "circuit", "meshes", "difference",
)  # fmt: skip
MOST_FAILURES_SHOWN = 10
SHOWN = ("max_slope", "mean_slope", "relative_slope")


@click.command(short_help="Readings over ranges or lists of parameters.")
@click.argument("source", metavar="SCENE|STUDY.toml")
@click.option(
    "--vary", multiple=True, metavar="NAME=VALUES", callback=assignments,
    help="Values of a parameter: start:stop:step (stop included), a,b,c, or @FILE with a value per line. If repeated, "
    "all combinations are computed. For a force the step may be omitted: fz=0:-20.",
)  # fmt: skip
@click.option(
    "--together", multiple=True, metavar="NAME=VALUES", callback=assignments,
    help="Values of a parameter that changes together with others: if repeated, values are combined row by row.",
)  # fmt: skip
@click.option(
    "--steps", type=click.Path(path_type=Path), metavar="STEPS.csv",
    help="Steps of a load path, one per row; columns are parameters.",
)  # fmt: skip
@defines_option
@target_error_option
@points_option
@time_budget_option
@seed_option
@folder_option
@workers_option
@scheduler_option
@retry_option
@click.option(
    "--meshes", type=click.Choice(["all", "last", "none"]), default="all", show_default=True,
    help="Deformed pads to keep: all, the last one of each curve, or none. With rough walls each takes 13 MB.",
)  # fmt: skip
@click.option("--maps", is_flag=True, help="Also write irradiance maps, as OpenEXR.")
@click.option("--difference", is_flag=True, help="Also store a camera's images minus that of the unloaded pad.")
@derivatives_option
@target_slope_option
@circuit_option
@click.option("--parquet", is_flag=True, help="Also write readings.parquet.")
@json_option
@debug_option
@click.pass_context
def command(
    ctx: click.Context,
    source: str,
    vary: dict[str, str],
    together: dict[str, str],
    steps: Path | None,
    defines: dict[str, str],
    target_error: float | None,
    points: int | None,
    time_budget: float | None,
    seed: int,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    retry_failed: bool,
    meshes: str,
    maps: bool,
    difference: bool,
    derivatives: list[str],
    target_slope: float | None,
    circuit: Path | None,
    parquet: bool,
    as_json: bool,
) -> None:
    """Compute the readings of a scene at all values of its varied parameters, or of all scenes of a study file.

    Each reading is stored in DIR as soon as it is computed, and the same command resumes an interrupted run. More
    values of a parameter, a further varied parameter, or a better target extend an existing study. Tables, meshes and a
    plot are written at the end. A scene with a camera gives an image for each value, and a contact sheet.
    """
    import xarray as xr

    from mitsuba_taxel.studies import run_study, sweep
    from mitsuba_taxel.studies.plan.batch import columns_of, parameters_in

    from ..tables import circuit_in, end_beyond_target, print_json, say, study_bar

    how: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "retry_failed": retry_failed, "parquet": parquet}
    with study_bar() as progress:
        if source.lower().endswith(".toml"):
            _refuse_options_of_a_scene(ctx)
            study = run_study(source, folder, progress=progress, **how)
        else:
            what: dict[str, Any] = {
                "target_error": target_error,
                "points": points,
                "time_budget": time_budget,
                "seed": seed,
                "maps": maps,
                "difference": difference,
                "meshes": meshes,
                "derivatives": derivatives,
                "target_slope": target_slope,
                "circuit": circuit_in(circuit),
            }
            rows = {**together, **(columns_of(steps, parameters=parameters_in(source)) if steps else {})}
            study = sweep(source, vary, defines, together=rows, output=folder, progress=progress, **what, **how)
    if "image" in study:
        show_images(study, folder, as_json)
        _end(study.attrs["failures"].splitlines(), folder)
        end_beyond_target(study.attrs["notes"].splitlines())
        return
    studies = {"": study}
    if isinstance(study, xr.DataTree):
        studies = {name: child.to_dataset() for name, child in study.children.items()}
    if as_json:
        described = {name: _as_json(child) for name, child in studies.items()}
        about = {"output": str(folder), "failures": study.attrs["failures"].splitlines()}
        print_json({**about, **(described.get("") or {"scenes": described})})
    else:
        for name, child in studies.items():
            _show(name, child, folder / name)
        say(f"Results: {folder}")
    _end(study.attrs["failures"].splitlines(), folder)
    notes = [(name, note) for name, child in studies.items() for note in child.attrs["notes"].splitlines()]
    end_beyond_target(f"{name}: {note}" if name else note for name, note in notes)


def show_images(study, folder: Path, as_json: bool) -> None:
    """Print the number of images of a study, their errors, and where they are.

    Parameters
    ----------
    study : xr.Dataset
        Table of the images.
    folder : Path
        Folder of the study.
    as_json : bool
        Whether to print an object.
    """
    from mitsuba_taxel.sensing.camera import RELATIVE_ERRORS

    from ..tables import known, print_json, say
    from .render import image_errors

    exists = study.image.values != ""
    count = int(exists.sum())
    errors = {name: float(study[name].values[exists].max()) for name in RELATIVE_ERRORS}  # NaN if one is unknown
    if as_json:
        files = [str(file) for file in study.image.values.ravel() if file]
        about = {"output": str(folder), "failures": study.attrs["failures"].splitlines()}
        print_json({**about, "images": files, **{name: known(error) for name, error in errors.items()}})
        return
    together = f"{folder / 'contact_sheet.png'} and {folder / 'film.png'}"
    say(f"{count} images in {folder / 'images'}, and all of them in {together}")
    say(f"Relative error of a pixel (root mean square), at most: {image_errors(*errors.values())}.")
    for note in study.attrs["notes"].splitlines():
        say(note)
    say(f"Results: {folder}")


def _refuse_options_of_a_scene(ctx: click.Context) -> None:
    for name in OF_A_SCENE:
        if ctx.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{name} is not allowed with a study file: write it into the file.")


def _as_json(study) -> dict[str, object]:
    from mitsuba_taxel.studies import stage_totals, study_error_budget
    from mitsuba_taxel.studies.store.tables import summary_table

    from ..tables import known, records

    budget = {source: known(fraction) for source, fraction in study_error_budget(study).items()}
    return {"sensitivity": records(summary_table(study)), "error_budget": budget, "seconds": stage_totals(study)}


def _show(name: str, study, folder: Path) -> None:
    from mitsuba_taxel.sensing.reading.wording import budget_line, light_of_study, stage_line
    from mitsuba_taxel.studies import stage_totals, study_error_budget

    from ..many_taxels import MOST_ROWS
    from ..tables import say

    if name:
        say(f"\n{name}:")
    print_slopes(study, folder)
    if study.sizes["taxel"] > MOST_ROWS:
        print_readings(study, folder)
    say(f"{int(study.power.notnull().sum())} readings, each {light_of_study(study)}.")
    for note in study.attrs["notes"].splitlines():
        say(note)
    say(budget_line(study_error_budget(study)))
    say(stage_line(stage_totals(study)))


def print_readings(study, folder: Path) -> None:
    """Print the readings of a study of many taxels: least, mean and most over the taxels, and a map of their changes.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.
    folder : Path
        Folder of its tables.
    """
    import numpy as np

    from ..many_taxels import HEADINGS, full_table, map_lines, study_quantities, summary_rows
    from ..tables import print_table, say

    quantities = study_quantities(study)
    say("Readings, over all scenes")
    print_table(HEADINGS, summary_rows(study.taxel.values.tolist(), quantities))
    say(full_table(study.sizes["taxel"], f"readings.csv in {folder}"))
    if "taxel_x" in study and study.taxel_x.dims == ("taxel",):
        say("Change of the power:")
        positions = np.stack([study.taxel_x.values, study.taxel_y.values], axis=1)
        for line in map_lines(quantities["change of the power [W]"], positions, "W"):
            print(line)


def print_slopes(study, folder: Path) -> None:
    """Print the slopes of a study and the figures of its circuit: a row for each taxel, or a summary of many taxels.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.
    folder : Path
        Folder of its tables.
    """
    from mitsuba_taxel.characterise import slope_summary, volts_notes, volts_table
    from mitsuba_taxel.characterise.roles import forces_by_parameter
    from mitsuba_taxel.characterise.wording import (
        AS_SHOWN,
        figure_rows,
        power_answer,
        remarks_explained,
        slope_answers,
        table_rows,
    )
    from mitsuba_taxel.electronics.volts import circuit_of_study

    from ..many_taxels import HEADINGS, MOST_ROWS, full_table, slope_rows, volts_rows
    from ..tables import print_figures, print_table, say

    channel, slopes = slope_summary(study)
    for line in filter(None, slope_answers(slopes, forces_by_parameter(study)) or [power_answer(study)]):
        say(f"{line}\n")
    many = study.sizes["taxel"] > MOST_ROWS
    if many and "taxel" in slopes and len(slopes):
        say("Slopes")
        print_table(HEADINGS, slope_rows(slopes, SHOWN))
    else:
        print_figures(", ".join(filter(None, ("Slopes", channel))), *table_rows(slopes, SHOWN))
        for line in remarks_explained(slopes[slopes.figure.isin(SHOWN)]):
            say(line)
    if len(slopes) and (circuit := circuit_of_study(study)):
        volts = volts_table(study, circuit)
        if many:
            say(f"\n{AS_SHOWN}")
            print_table(HEADINGS, volts_rows(volts))
        else:
            print_figures(AS_SHOWN, *figure_rows(volts))
        for line in volts_notes(volts, circuit):
            say(line)
    if many and len(slopes):
        say(full_table(study.sizes["taxel"], f"summary.csv and readings.csv in {folder}"))


def _end(failures: list[str], folder: Path) -> None:
    """List the failures of a study, and end the program with exit code 1 if there are any."""
    for line in failures[:MOST_FAILURES_SHOWN]:
        click.echo(f"failed: {line}", err=True)
    if len(failures) > MOST_FAILURES_SHOWN:
        click.echo(f"failed: {len(failures) - MOST_FAILURES_SHOWN} more (their reasons are in {folder})", err=True)
    if failures:
        click.echo("The same command with --retry-failed repeats what failed.", err=True)
        raise click.exceptions.Exit(1)
