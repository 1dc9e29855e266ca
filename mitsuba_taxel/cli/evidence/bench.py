"""`taxel bench`: benchmarks of robustness, accuracy and speed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import click

from ..options import csv_option, debug_option, defines_option, folder_option, markdown_option
from .bench_peers import peers

Row = TypeVar("Row")


@click.group(short_help="Benchmarks: extreme cases, stated and true errors, error against time.")
@debug_option
def command() -> None:
    """Benchmarks: robustness in extreme cases, coverage of stated errors, and error against time."""


command.add_command(peers)


def _shown(
    rows: Iterable[Row],
    headings: Sequence[str],
    table: Callable[[Sequence[Row]], Iterable[Sequence[str]]],
    keep: Callable[[Sequence[Row]], None] | None = None,
    summary: Callable[[Sequence[Row]], str] | None = None,
) -> list[Row]:
    """Print rows of a benchmark as a table, and store them after each row. Rows measured so far are printed even after
    an error."""
    from ..tables import print_text_table, say

    measured: list[Row] = []
    try:
        for row in rows:
            measured.append(row)
            if keep:
                keep(measured)
    finally:
        print_text_table(headings, table(measured))
        if summary:
            say(summary(measured))
    return measured


def _say(name: str) -> None:
    click.echo(name, err=True)


@command.command("stability", short_help="Pads, loads, readings and circuits at the extremes.")
@click.option("--only", metavar="PATTERN", help="Only rows whose name contains this; * and ? are wildcards.")
@click.option("--csv", type=click.Path(path_type=Path), metavar="FILE", help="Also write the rows with all digits.")
@markdown_option
@debug_option
def stability_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Load pads, read sensors and circuits in extreme cases, and report the outcome of each.

    Rows are measured one by one, each in its own process; files contain those measured so far.
    """
    from mitsuba_taxel.evidence.extremes.circuit_row import CircuitRow
    from mitsuba_taxel.evidence.extremes.reading_row import ReadingRow
    from mitsuba_taxel.evidence.extremes.stability import check, stability
    from mitsuba_taxel.evidence.extremes.tables import AnyRow
    from mitsuba_taxel.evidence.rows.row import MechanicsRow, cells, headings

    from ..tables import print_text_table

    def starting(number: int, count: int, name: str) -> None:
        click.echo(f"{number}/{count} {name}: ", nl=False, err=True)

    rows: list[AnyRow] = []
    try:
        for row in stability(only, csv, markdown, starting):
            rows.append(row)
            click.echo(f"{row.verdict}{f'; WRONG: {row.wrong}' if row.wrong else ''}", err=True)
    finally:
        for kind in (MechanicsRow, ReadingRow, CircuitRow):
            if table := [cells(row) for row in rows if isinstance(row, kind)]:
                print_text_table(headings(kind), table)
    check(rows)


@command.command("coverage", short_help="Stated against true errors of readings and figures.")
@click.option("--only", metavar="PATTERN", help="Only cases whose name contains this; * and ? are wildcards.")
@click.option(
    "--part", type=click.Choice(["readings", "figures", "probabilities"]), help="Only this table; all by default."
)
@csv_option
@markdown_option
@debug_option
def coverage_command(only: str | None, part: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Compare stated errors with true errors.

    Readings: the stated errors due to the finite elements. Pads under load are read one by one, each in its own
    process, the fastest first.

    Figures: the stated errors of results that need no pad. They are computed from synthetic data: recordings,
    tolerances, fits, calibrations, exported models, noise-equivalent forces and differences of variants.

    Probabilities: the stated probabilities of a comparison of variants. They are compared with observed frequencies.

    Files contain the rows measured so far. Figures and probabilities have separate files beside that of the
    readings. Selected figures and probabilities are always computed anew; the others stay as they are.
    """
    from mitsuba_taxel.evidence.coverage import coverage as tables
    from mitsuba_taxel.evidence.coverage.coverage_row import CoverageRow, summary
    from mitsuba_taxel.evidence.intervals import intervals, probabilities
    from mitsuba_taxel.evidence.rows.row import cells, headings

    parts = tables.parts_with_cases(only, part)
    if "readings" in parts:
        rows = tables.coverage(only, csv, markdown, lambda k, n, name: _say(f"{k}/{n} {name}"))
        _shown(rows, headings(CoverageRow), partial(map, cells), summary=summary)
    if "figures" in parts:
        figures = tables.figures_without_pad(only, csv, markdown, _say)
        _shown(figures, headings(intervals.IntervalRow), partial(map, cells), summary=intervals.summary)
    if "probabilities" in parts:
        true = tables.probabilities(only, csv, markdown, _say)
        _shown(true, headings(probabilities.ProbabilityRow), partial(map, cells), summary=probabilities.summary)


@command.command("light", short_help="Readings with and without random numbers, of random optics.")
@click.option("--only", metavar="PATTERN", help="Only configurations whose name contains this; * and ? are wildcards.")
@csv_option
@markdown_option
@debug_option
def light_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Compare readings and derivatives without random numbers with those of random paths.

    Laws, walls, shapes and sizes are drawn at random. Each configuration is read in its own process.
    """
    from mitsuba_taxel.evidence.coverage.light import light, summary
    from mitsuba_taxel.evidence.coverage.light_row import LightRow
    from mitsuba_taxel.evidence.rows.row import cells, headings

    rows = light(only, csv, markdown, lambda k, n, name: _say(f"{k}/{n} {name}"))
    _shown(rows, headings(LightRow), partial(map, cells), summary=summary)


@command.command("drags", short_help="Dragged bodies compared with pressed-in bodies.")
@click.option("--only", metavar="PATTERN", help="Only states whose name contains this; * and ? are wildcards.")
@csv_option
@markdown_option
@debug_option
def drags_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Compare forces and roof displacements under a body dragged across the pad with those of a body pressed in there.

    Each state is solved in its own process; files contain those solved so far, which are not solved again.
    """
    from mitsuba_taxel.evidence.coverage.drags import DragRow, drags, summary
    from mitsuba_taxel.evidence.rows.row import cells, headings

    rows = drags(only, csv, markdown, lambda k, n, name: _say(f"{k}/{n} {name}"))
    _shown(rows, headings(DragRow), partial(map, cells), summary=summary)


@command.command("figures", short_help="Slopes and nonlinearities of random scenes, with errors.")
@click.option("--only", metavar="PATTERN", help="Only scenes whose name contains this; * and ? are wildcards.")
@csv_option
@markdown_option
@debug_option
def figures_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Compare figures of merit of random scenes, and their stated errors, with results on finer elements.

    Each scene is swept at the default settings and with two target errors, in a separate process.
    """
    from mitsuba_taxel.evidence.coverage.figures import HEADINGS, cells, figures, summary

    rows = figures(only, csv, markdown, lambda k, n, name: _say(f"{k}/{n} {name}"))
    _shown(rows, HEADINGS, partial(map, cells), summary=summary)


@command.command("domes", short_help="Domed cells against spheres and fine meshes.")
@markdown_option
@debug_option
def domes_command(markdown: Path | None) -> None:
    """Compare readings of domed cells with references: exact spheres if unloaded, fine meshes if loaded."""
    from mitsuba_taxel.evidence.domes import domes

    def keep(rows: Sequence[domes.DomeRow], pads: Sequence[domes.PadRow] = ()) -> None:
        if markdown:
            domes.write_page(rows, pads, markdown, f"taxel bench domes --markdown {markdown}")

    rows = _shown(domes.domes(_say), domes.HEADINGS, partial(map, domes.dome_cells), keep)
    mirrors = domes.mirrors_of_pads(_say)
    _shown(mirrors, domes.PAD_HEADINGS, partial(map, domes.pad_cells), partial(keep, rows))


@command.command("slopes", short_help="Derivatives of readings against those on fine meshes.")
@markdown_option
@debug_option
def slopes_command(markdown: Path | None) -> None:
    """Compare derivatives with respect to force, material and dimensions on default and fine meshes, for all cell
    shapes."""
    from mitsuba_taxel.evidence.domes.slopes import HEADINGS, SlopeRow, slope_cells, slopes, summary, write_page

    def keep(rows: Sequence[SlopeRow]) -> None:
        if markdown:
            write_page(rows, markdown, f"taxel bench slopes --markdown {markdown}")

    _shown(slopes(_say), HEADINGS, partial(map, slope_cells), keep, summary)


@command.command("rough", short_help="Slopes of cells with rough walls: errors and time.")
@markdown_option
@debug_option
def rough_command(markdown: Path | None) -> None:
    """Print how readings of cells with rough walls or rough mirrors change with force: slopes, errors and CPU times.

    Errors are stated by cause: light, interpolation between forces, and finite elements.
    """
    from mitsuba_taxel.evidence.domes.rough_slopes import RoughRow, rough_slopes, write_page
    from mitsuba_taxel.evidence.rows.row import cells, headings

    rows = _shown(rough_slopes(_say), headings(RoughRow), partial(map, cells))
    if markdown:
        write_page(rows, markdown, f"taxel bench rough --markdown {markdown}")


@command.command("fillets", short_help="Ends of load paths and slopes of boxes with sharp and rounded edges.")
@markdown_option
@debug_option
def fillets_command(markdown: Path | None) -> None:
    """Print where the load paths of one box end, and its slopes along x, with sharp and rounded edges on elements of
    several sizes.
    """
    from mitsuba_taxel.evidence.domes.fillets import EdgeSlopeRow, EndRow, edge_slopes, ends, write_page
    from mitsuba_taxel.evidence.rows.row import cells, headings

    ended = _shown(ends(_say), headings(EndRow), partial(map, cells))
    slopes = _shown(edge_slopes(_say), headings(EdgeSlopeRow), partial(map, cells))
    if markdown:
        write_page(ended, slopes, markdown, f"taxel bench fillets --markdown {markdown}")


@command.command("parts", short_help="Curves of photo-reflectors beside their datasheets.")
@markdown_option
@debug_option
def parts_command(markdown: Path | None) -> None:
    """Print computed currents over distance beside those of datasheets, and candidates for the dies of the VCNT2020."""
    from mitsuba_taxel.evidence.measured import part_curves

    from ..tables import print_text_table, say

    rows, candidates = part_curves.part_rows(), part_curves.explanations()
    print_text_table(part_curves.HEADINGS, map(part_curves.cells, rows))
    say()
    print_text_table(part_curves.EXPLANATION_HEADINGS, map(part_curves.explanation_cells, candidates))
    if markdown:
        part_curves.write_page(rows, candidates, markdown, f"taxel bench parts --markdown {markdown}")


@command.command("estimators", short_help="Estimators of random paths against plain paths.")
@click.option("--only", metavar="PATTERN", help="Only scenes whose name contains this; * and ? are wildcards.")
@csv_option
@markdown_option
@debug_option
def estimators_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Compare two estimators of random paths with plain random paths.

    One connects LED and phototransistor over mirrors. The other takes differences between two loads along paths
    through the same points of the silicone. Scenes are drawn at random; each is read in a separate process.
    """
    from mitsuba_taxel.evidence.coverage.estimators import EstimatorRow, estimators, summary
    from mitsuba_taxel.evidence.rows.row import cells, headings

    rows = estimators(only, csv, markdown, lambda k, n, name: _say(f"{k}/{n} {name}"))
    _shown(rows, headings(EstimatorRow), partial(map, cells), summary=summary)


@command.command("horizon", short_help="Derivatives for several widths of the horizon.")
@markdown_option
@debug_option
def horizon_command(markdown: Path | None) -> None:
    """Compare derivatives with differences of readings, for several widths of the horizon.

    The horizon is the plane of a wall, below which the wall neither emits nor receives light. The step of the light at
    the horizon is spread over a width. Derivatives are taken along lines of designs.
    """
    from mitsuba_taxel.evidence.domes.horizon import HorizonRow, horizon, write_page
    from mitsuba_taxel.evidence.rows.row import cells, headings

    rows = _shown(horizon(_say), headings(HorizonRow), partial(map, cells))
    if markdown:
        write_page(rows, markdown, f"taxel bench horizon --markdown {markdown}")


@command.command("nominal", short_help="The paper's study of four shapes: errors and seconds.")
@click.option("--only", metavar="PATTERN", help="Only shapes whose name contains this; * and ? are wildcards.")
@markdown_option
@debug_option
def nominal_command(only: str | None, markdown: Path | None) -> None:
    """Measure time and error of the paper's study of four shapes, to 0.5 % and with slopes to 2 %, with empty caches.

    The cells are read under normal and tangential forces.
    """
    from mitsuba_taxel.evidence.accuracy.nominal import HEADINGS, NominalRow, nominal, nominal_cells, write_page

    def keep(rows: Sequence[NominalRow]) -> None:
        if markdown:
            pattern = f"--only '{only}' " if only else ""
            write_page(rows, markdown, f"taxel bench nominal {pattern}--markdown {markdown}")

    _shown(nominal(only, _say), HEADINGS, nominal_cells, keep)


@command.command("accuracy", short_help="Error against time of every method.")
@click.argument("scene", required=False)
@defines_option
@folder_option
@click.option(
    "--seconds",
    type=click.FloatRange(min=0, min_open=True),
    default=5.0,
    show_default=True,
    help="Time in s for each method of light transport, and for the longest solution of the mechanics; references "
    "take longer.",
)
@debug_option
def accuracy_command(scene: str | None, defines: dict[str, str], folder: Path, seconds: float) -> None:
    """Measure the error and the time of every method that reads SCENE, and write a table, a CSV file and a diagram.

    Light: each integrator is compared with one of another family. Mechanics: several element sizes and load steps are
    compared with much smaller ones. Whole chain: readings and slopes at several target errors are compared with those
    on a fine mesh with many paths.

    Without a SCENE, one cell is measured with several settings: sizes of the patches for light without random numbers,
    numbers of random paths, derivatives with either, and depths of a touch.
    """
    from mitsuba_taxel.evidence.accuracy.accuracy import accuracy
    from mitsuba_taxel.evidence.accuracy.mechanics import ELEMENTS
    from mitsuba_taxel.evidence.accuracy.settings import settings_accuracy
    from mitsuba_taxel.evidence.accuracy.tables import HEADINGS, PEERS, POINT_HEADINGS, cells, point_cells
    from mitsuba_taxel.sensing import Scene

    from ..tables import print_text_table, say

    if scene is None:
        if defines:
            raise click.UsageError("-D is not allowed without a SCENE.")
        curves = settings_accuracy(folder, seconds, _say)
        print_text_table(POINT_HEADINGS, [row for curve in curves for row in point_cells(curve)])
        click.echo("Seconds are CPU time of all processors, without compilation.")
        return
    curves = accuracy(Scene.from_file(scene, **defines), folder, seconds, _say)
    print_text_table(HEADINGS, map(cells, curves))
    click.echo("Seconds are CPU time of all processors, without compilation.")
    if any(curve.part == "mechanics" and curve.points for curve in curves):
        say(ELEMENTS)
    say(PEERS)


@command.command("speed", short_help="Run times, and rays per second.")
@click.option(
    "--target-error",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=1e-3,
    show_default=True,
    help="Largest relative error of the readings of nine taxels.",
)
@debug_option
def speed_command(target_error: float) -> None:
    """Measure run times: of readings of all cell shapes, of the first reading of a new process, and of the ray tracer
    compared with ray intersections alone."""
    from mitsuba_taxel.evidence.accuracy.speed import speed

    for line in speed(target_error):
        click.echo(line)


@command.command("cells", short_help="CPU time, memory and error of pads of many cells.")
@click.option(
    "--sides",
    default="3,6,9,12",
    show_default=True,
    metavar="N,...",
    help="Rows and columns of the square pads.",
)
@click.option("--ball", is_flag=True, help="Press a ball off the centre, so that nothing is symmetric.")
@click.option(
    "--seconds",
    type=click.FloatRange(0, min_open=True),
    default=600.0,
    show_default=True,
    help="Longest wall time for a pad, in s.",
)
@debug_option
def cells_command(sides: str, ball: bool, seconds: float) -> None:
    """Measure CPU time, memory and error for square pads with more and more cells, each in a separate process."""
    from mitsuba_taxel.base.errors import InputError
    from mitsuba_taxel.evidence.accuracy.many_cells import ManyCellsRow, growth_line, many_cells
    from mitsuba_taxel.evidence.rows.row import cells, headings

    if not all(side.strip().isdecimal() and 1 <= int(side) <= 100 for side in sides.split(",")):
        raise InputError(f"sides = {sides!r} is not allowed: whole numbers from 1 to 100, such as 3,6,12, are needed.")
    rows = many_cells([int(side) for side in sides.split(",")], ball, seconds, _say)
    _shown(rows, headings(ManyCellsRow), partial(map, cells), summary=growth_line)


@command.command("contact", short_help="Speed of contact models, and their error against Hertz.")
@click.option(
    "--patches", default="15,30", show_default=True, metavar="N,...", help="Numbers of patches along each side."
)
@click.option(
    "--pads", type=click.IntRange(1, 100_000), default=4096, show_default=True, help="Number of pads in one call."
)
@debug_option
def contact_command(patches: str, pads: int) -> None:
    """Time the contact model of a half-space with nine taxels under balls: in numpy, and in ONNX and JAX if they are
    installed."""
    from mitsuba_taxel.base.errors import InputError
    from mitsuba_taxel.evidence.accuracy.contact_models import ContactSpeedRow, contact_speed
    from mitsuba_taxel.evidence.rows.row import cells, headings

    counts = patches.split(",")
    if not all(count.strip().isdecimal() and 3 <= int(count) <= 50 for count in counts):
        raise InputError(f"patches = {patches!r} is not allowed: whole numbers from 3 to 50, as in 15,30, are needed.")
    _shown(contact_speed([int(count) for count in counts], pads), headings(ContactSpeedRow), partial(map, cells))


@command.command("omitted-work", short_help="Savings from omitted work.")
@click.option("--scene", "scenes", multiple=True, metavar="NAME", help="Scene, all by default. May be repeated.")
@markdown_option
@debug_option
def omitted_work_command(scenes: tuple[str, ...], markdown: Path | None) -> None:
    """Measure how much time is saved because unneeded work is omitted: scenes are read as usual, and with that work."""
    from mitsuba_taxel.base.files.atomic import write_text
    from mitsuba_taxel.evidence.accuracy.omitted_work import HEADINGS, page, table

    rows = []
    click.echo(" | ".join(HEADINGS))
    for row in table(scenes):
        rows.append(row)
        click.echo(" | ".join(row))
    if markdown:
        write_text(markdown, page(rows))
