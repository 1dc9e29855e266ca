"""`taxel bench peers`: comparison with other programs on the same cases."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

import click

from ..options import debug_option

csv_option = click.option(
    "--csv", "file", type=click.Path(path_type=Path), metavar="FILE", help="Also write the rows to this file."
)


@click.group("peers", short_help="Other programs on the same cases.")
@debug_option
def peers() -> None:
    """Run other programs that are installed on the same cases.

    Nothing else should run meanwhile: times are wall times.
    """


@peers.command("optics", short_help="Errors, times and figures of merit of the light.")
@click.option("--case", "cases", multiple=True, metavar="NAME", help="Case to run, all by default. May be repeated.")
@click.option(
    "--peer", "systems", multiple=True, metavar="NAME",
    help="Program to run, or none for this one alone; all by default.",
)  # fmt: skip
@click.option(
    "--runs", type=click.IntRange(min=16), default=32, show_default=True,
    help="Number of runs with independent seeds.",
)  # fmt: skip
@click.option(
    "--seconds", type=click.FloatRange(min=0, min_open=True), default=0.5, show_default=True,
    help="Length of a run in s.",
)  # fmt: skip
@csv_option
@debug_option
def optics_command(
    cases: tuple[str, ...], systems: tuple[str, ...], runs: int, seconds: float, file: Path | None
) -> None:
    """Compare the light of this program's integrators with that of other programs."""
    from mitsuba_taxel.evidence.peers.optics import COLUMNS, table

    _show(COLUMNS, table(cases, systems, runs, seconds), file)


@peers.command("mechanics", short_help="Errors, times and memory of the pad's mechanics.")
@click.argument("tables", nargs=-1, type=click.Choice(["solve", "paths", "cells", "parts", "contact", "solvers"]))
@csv_option
@debug_option
def mechanics_command(tables: tuple[str, ...], file: Path | None) -> None:
    """Compare the mechanics with CalculiX (solve); time the paper's load paths (paths), larger pads (cells) and the
    parts of a solution (parts); count the factorisations under indenters (contact); compare linear solvers
    (solvers)."""
    from mitsuba_taxel.evidence.peers.mechanics import TABLES

    for name in tables or TABLES:
        rows = TABLES[name]()
        click.echo(f"\n{name}: {' '.join(str(TABLES[name].__doc__).split())}")
        _show(next(rows), rows, file and file.with_stem(f"{file.stem}-{name}"))


@peers.command("elements", short_help="Node-by-node comparison with CalculiX.")
@click.option(
    "--mesh-size", "sizes", multiple=True, type=float, metavar="MM",
    help="Size of the elements. May be repeated.",
)  # fmt: skip
@click.option(
    "--poisson-ratio", "ratios", multiple=True, type=float, metavar="NU",
    help="Poisson's ratio. May be repeated.",
)  # fmt: skip
@csv_option
@debug_option
def elements_command(sizes: tuple[float, ...], ratios: tuple[float, ...], file: Path | None) -> None:
    """Compare CalculiX node by node with our implementation of the same element, on the same mesh."""
    from mitsuba_taxel.evidence.peers.elements import COLUMNS, MESH_SIZES, POISSON_RATIOS, table

    _show(COLUMNS, table(sizes or MESH_SIZES, ratios or POISSON_RATIOS), file)


@peers.command("ball", short_help="A ball pressed into a cell, beside CalculiX.")
@click.option(
    "--mesh-size", "sizes", multiple=True, type=float, metavar="MM",
    help="Size of the elements. May be repeated.",
)  # fmt: skip
@click.option("--depth", "depths", multiple=True, type=float, metavar="MM", help="Depth of the ball. May be repeated.")
@csv_option
@debug_option
def ball_command(sizes: tuple[float, ...], depths: tuple[float, ...], file: Path | None) -> None:
    """Compare the force and the displacement under a ball with CalculiX, on the same mesh."""
    from mitsuba_taxel.evidence.peers.pressed_ball import COLUMNS, DEPTHS, MESH_SIZES, table

    _show(COLUMNS, table(sizes or MESH_SIZES, depths or DEPTHS), file)


@peers.command("plate", short_help="A plate that tilts on a cell, beside CalculiX.")
@click.option(
    "--mesh-size", "sizes", multiple=True, type=float, metavar="MM",
    help="Size of the elements. May be repeated.",
)  # fmt: skip
@click.option(
    "--tilt", "tilts", multiple=True, type=click.Choice(["small", "large"]),
    help="Tilt of the plate, both by default.",
)  # fmt: skip
@csv_option
@debug_option
def plate_command(sizes: tuple[float, ...], tilts: tuple[str, ...], file: Path | None) -> None:
    """Compare the rotation, force and moment of a tilting plate with CalculiX, on the same mesh."""
    from mitsuba_taxel.evidence.peers.tilted_plate import COLUMNS, MESH_SIZES, WRENCHES, table

    _show(COLUMNS, table(sizes or MESH_SIZES, tilts or tuple(WRENCHES)), file)


def _show(columns: Sequence[object], rows: Iterable[Sequence[object]], file: Path | None) -> None:
    """Print rows as they are measured, and write all of them at the end."""
    kept = []
    for row in chain([columns], rows):
        click.echo("  ".join(f"{cell!s:16}" for cell in row).rstrip())
        kept.append(row)
    if file:
        from mitsuba_taxel.base.files.atomic import replacing

        with replacing(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows(kept)
