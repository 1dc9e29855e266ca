"""Options that several subcommands have."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click


class Fraction(click.ParamType):
    """A command-line value strictly between 0 and 1, written as a fraction (0.002) or in percent (0.2%)."""

    name = "share"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        text = str(value).strip()
        try:
            fraction = float(text[:-1]) / 100 if text.endswith("%") else float(text)
        except ValueError:
            self.fail(f"{value!r} is not a number such as 0.2% or 0.002.", param, ctx)
        if not 0 < fraction < 1:
            self.fail(f"{value!r} is not allowed: above 0 and below 100% is needed.", param, ctx)
        return fraction


class _Duration(click.ParamType):
    """A time above 0, in s: plain seconds, or with a unit such as 500ms, 60s, 2min."""

    name = "time"
    units = {"ms": 1e-3, "min": 60.0, "s": 1.0, "": 1.0}

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        text = str(value).strip()
        unit = next(unit for unit in self.units if text.endswith(unit))
        try:
            seconds = float(text.removesuffix(unit)) * self.units[unit]
        except ValueError:
            self.fail(f"{value!r} is not a time such as 60s, 500ms, 2min or plain seconds.", param, ctx)
        if not 0 < seconds < math.inf:
            self.fail(f"{value!r} is not allowed: a finite time above 0 is needed.", param, ctx)
        return seconds


class NewFile(click.ParamType):
    """A command-line value that is the name of a file to be written, with an allowed suffix, in a writable folder."""

    name = "file"

    def __init__(self, *suffixes: str) -> None:
        self.suffixes = suffixes

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        from mitsuba_taxel.studies.plan.files import check_new_file

        check_new_file(Path(value), *self.suffixes)
        return Path(value)


def assignments(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Convert words ``name=value`` of the command line into a dictionary; names must be distinct."""
    pairs: dict[str, str] = {}
    for word in values:
        name, equals, value = word.partition("=")
        if not (name and equals and value):
            raise click.BadParameter(f"{word!r} is not of the form name=value.", ctx, param)
        if name in pairs:
            raise click.BadParameter(f"{name} is given twice: give it once.", ctx, param)
        pairs[name] = value
    return pairs


def _set_debug(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value:
        ctx.obj.debug = True


debug_option = click.option(
    "--debug", is_flag=True, is_eager=True, expose_value=False, callback=_set_debug, help="Show an error's traceback."
)
defines_option = click.option(
    "-D", "defines", multiple=True, metavar="NAME=VALUE", callback=assignments,
    help="Value of a parameter (a <default> of the scene). The value none removes the elements that use it. May be "
    "repeated.",
)  # fmt: skip
target_error_option = click.option(
    "--target-error",
    type=Fraction(),
    help="Largest relative error of a reading due to light and mechanics, such as 0.2% or 0.002; the mesh is chosen to "
    "reach it. If it is not reached, the exit code is 3.",
    show_default="0.5% of the light alone",
)
seed_option = click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True, help="Seed of the random numbers."
)
target_slope_option = click.option(
    "--target-slope",
    type=Fraction(),
    help="Largest error of the slopes against the varied forces, relative to the slope of the steepest taxel, such as "
    "1% or 0.01; mesh and points are chosen to reach it. Slopes are derivatives or, with random paths, slopes of "
    "curves through the readings. If the target is not reached, the exit code is 3.",
)
derivatives_option = click.option(
    "--derivatives",
    default="",
    metavar="NAME,...",
    callback=lambda ctx, param, names: [name.strip() for name in names.split(",") if name.strip()],
    help="Also compute derivatives of the readings with respect to these parameters, such as fz,cell_size.",
)
points_option = click.option(
    "--points", type=click.IntRange(min=1),
    help="Number of light paths per taxel and randomisation (an independent repetition), instead of a target error.",
)
time_budget_option = click.option(
    "--time-budget",
    type=_Duration(),
    help="Longest run time, such as 60s, 500ms or 2min: steps that would not end in time are not started. If readings "
    "of a sweep are missing then, the exit code is 3.",
)
circuit_option = click.option(
    "--circuit",
    type=click.Path(path_type=Path),
    metavar="CIRCUIT.toml",
    help="Also print volts and counts at the output of this circuit; `taxel new circuit` writes a template.",
)
workers_option = click.option("--workers", type=int, metavar="N", help="Number of worker processes on this machine.")
scheduler_option = click.option(
    "--scheduler", metavar="ADDRESS", help="Address of a Dask scheduler whose workers are used, such as tcp://host:8786."
)
retry_option = click.option("--retry-failed", is_flag=True, help="Repeat jobs that failed in an earlier run.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of tables.")
folder_option = click.option(
    "-o", "--output", "folder", required=True, type=click.Path(path_type=Path), metavar="DIR",
    help="Folder for the results.",
)  # fmt: skip
csv_option = click.option(
    "--csv", type=click.Path(path_type=Path), metavar="FILE",
    help="Also write the rows with all digits; rows already in the file are not measured again.",
)  # fmt: skip
markdown_option = click.option(
    "--markdown", type=NewFile(".md"), metavar="FILE", help="Also write a page with the table."
)


def output_option(name: str, what: str) -> Callable:
    """Option for the file to be written, by default ``name``."""
    suffix = Path(name).suffix
    return click.option(
        "-o", "--output", type=NewFile(suffix), default=name, show_default=True, metavar=f"FILE{suffix}", help=what
    )


def on_a_study_file(command: Callable) -> Callable:
    """Add the arguments and options of commands that read a table of a study file."""
    source = click.argument("source", metavar="STUDY.toml", type=click.Path(path_type=Path))
    for add in (debug_option, json_option, scheduler_option, workers_option, folder_option, source):
        command = add(command)
    return command
