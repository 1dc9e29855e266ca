"""`taxel bench`: tables that say how the program does, made anew."""

from __future__ import annotations

from pathlib import Path

import click

from .bench_peers import peers
from .options import debug_option, defines_option, folder_option


@click.group(short_help="How the program does: extremes, errors stated and true, error against time.")
@debug_option
def command() -> None:
    """Measure how the program does: at the extremes, what its errors are worth, and error against time."""


command.add_command(peers)


@command.command("stability", short_help="Pads, loads and readings at the extremes.")
@click.option("--only", metavar="PATTERN", help="Part of the names of the rows wanted; * and ? stand for anything.")
@click.option("--csv", type=click.Path(path_type=Path), metavar="FILE", help="Also write the rows, all digits.")
@click.option("--markdown", type=click.Path(path_type=Path), metavar="FILE", help="Also write a page with the table.")
@debug_option
def stability_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Load pads and read sensors at the extremes, and say what became of each.

    Rows are measured one by one, each in a process of its own; files hold those measured so far.
    """
    from mitsuba_taxel.bench.reading_row import READING_HEADINGS, ReadingRow, reading_cells
    from mitsuba_taxel.bench.row import HEADINGS, Row, cells
    from mitsuba_taxel.bench.stability import check, stability

    from .tables import print_text_table

    def starting(number: int, count: int, name: str) -> None:
        click.echo(f"{number}/{count} {name}: ", nl=False, err=True)

    rows: list[Row | ReadingRow] = []
    try:
        for row in stability(only, csv, markdown, starting):
            rows.append(row)
            click.echo(f"{row.verdict}{f'; WRONG: {row.wrong}' if row.wrong else ''}", err=True)
    finally:
        mechanics = [cells(row) for row in rows if isinstance(row, Row)]
        readings = [reading_cells(row) for row in rows if isinstance(row, ReadingRow)]
        for headings, table in ((HEADINGS, mechanics), (READING_HEADINGS, readings)):
            if table:
                print_text_table(list(headings.values()), table)
    check(rows)


@command.command("coverage", short_help="Stated against true errors of readings.")
@click.option("--only", metavar="PATTERN", help="Part of the names of the settings wanted; * and ? for anything.")
@click.option(
    "--csv",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also write the rows, all digits; those that are there already are not measured again.",
)
@click.option("--markdown", type=click.Path(path_type=Path), metavar="FILE", help="Also write a page with the table.")
@debug_option
def coverage_command(only: str | None, csv: Path | None, markdown: Path | None) -> None:
    """Compare the errors that readings state for the finite elements with those that they have.

    Settings of pads and loads are read one by one, each in a process of its own, the quickest first; files hold those
    read so far.
    """
    from mitsuba_taxel.bench.coverage import coverage, summary
    from mitsuba_taxel.bench.coverage_row import HEADINGS, coverage_cells

    from .tables import print_text_table

    rows = []
    try:
        for row in coverage(only, csv, markdown, lambda k, n, name: click.echo(f"{k}/{n} {name}", err=True)):
            rows.append(row)
    finally:
        print_text_table(list(HEADINGS.values()), map(coverage_cells, rows))
        click.echo(summary(rows))


@command.command("domes", short_help="Domed cells beside spheres and small elements.")
@click.option("--markdown", type=click.Path(path_type=Path), metavar="FILE", help="Also write a page with the table.")
@debug_option
def domes_command(markdown: Path | None) -> None:
    """Read domed cells whose truth is known otherwise: unloaded ones are spheres, loaded ones take small elements."""
    from mitsuba_taxel.bench.domes import HEADINGS, dome_cells, domes, write_page
    from mitsuba_taxel.studies.plan.files import check_new_file

    from .tables import print_text_table

    if markdown:
        check_new_file(markdown, ".md")
    rows = []
    try:
        for row in domes(lambda name: click.echo(name, err=True)):
            rows.append(row)
            if markdown:
                write_page(rows, markdown, f"taxel bench domes --markdown {markdown}")
    finally:
        print_text_table(HEADINGS, map(dome_cells, rows))


@command.command("slopes", short_help="Derivatives of readings beside those on small elements.")
@click.option("--markdown", type=click.Path(path_type=Path), metavar="FILE", help="Also write a page with the table.")
@debug_option
def slopes_command(markdown: Path | None) -> None:
    """Differentiate readings of all cell shapes by force, material and dimensions, on default and on small elements."""
    from mitsuba_taxel.bench.slopes import HEADINGS, slope_cells, slopes, summary, write_page
    from mitsuba_taxel.studies.plan.files import check_new_file

    from .tables import print_text_table

    if markdown:
        check_new_file(markdown, ".md")
    rows = []
    try:
        for row in slopes(lambda name: click.echo(name, err=True)):
            rows.append(row)
            if markdown:
                write_page(rows, markdown, f"taxel bench slopes --markdown {markdown}")
    finally:
        print_text_table(HEADINGS, map(slope_cells, rows))
        click.echo(summary(rows))


@command.command("accuracy", short_help="Error against time of every way to read a scene.")
@click.argument("scene")
@defines_option
@folder_option
@click.option(
    "--seconds",
    type=click.FloatRange(min=0, min_open=True),
    default=5.0,
    show_default=True,
    help="Time in s for each way to compute the light, and for the longest solution of the mechanics; references "
    "take longer.",
)
@debug_option
def accuracy_command(scene: str, defines: dict[str, str], folder: Path, seconds: float) -> None:
    """Measure what error every way to read SCENE has after how much time, as table, CSV and diagram.

    Light: each integrator, judged by one of another family. Mechanics: element sizes and load steps, judged by much
    smaller ones. Chain: readings and slopes to a target error, judged by small elements with long light.
    """
    from mitsuba_taxel.bench.accuracy import accuracy
    from mitsuba_taxel.bench.accuracy_mechanics import ELEMENTS
    from mitsuba_taxel.bench.accuracy_tables import HEADINGS, PEERS, cells
    from mitsuba_taxel.sensing import Scene

    from .tables import print_text_table

    curves = accuracy(Scene.from_file(scene, **defines), folder, seconds, lambda step: click.echo(step, err=True))
    print_text_table(HEADINGS, map(cells, curves))
    click.echo("Seconds are of all processors together; compilation is not in them.")
    if any(curve.part == "mechanics" and curve.points for curve in curves):
        click.echo(ELEMENTS)
    click.echo(PEERS)


@command.command("speed", short_help="Times as a user meets them, and rays per second.")
@click.option(
    "--target-error",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=1e-3,
    show_default=True,
    help="Relative, of the worst of nine taxels.",
)
@debug_option
def speed_command(target_error: float) -> None:
    """Time readings of all cell shapes, the first answer of a new process, and the tracer beside bare intersections."""
    from mitsuba_taxel.bench.speed import speed

    for line in speed(target_error):
        click.echo(line)


@command.command("omitted-work", short_help="What leaving out saves.")
@click.option("--scene", "scenes", multiple=True, metavar="NAME", help="Which scenes; all by default.")
@click.option("--markdown", type=click.Path(path_type=Path), metavar="FILE", help="Also write a page with the table.")
@debug_option
def omitted_work_command(scenes: tuple[str, ...], markdown: Path | None) -> None:
    """Read shipped scenes as they are, and with what they do not need done all the same."""
    from mitsuba_taxel.bench.omitted_work import HEADINGS, page, table

    rows = []
    click.echo(" | ".join(HEADINGS))
    for row in table(scenes):
        rows.append(row)
        click.echo(" | ".join(row))
    if markdown:
        markdown.write_text(page(rows), encoding="utf-8")
