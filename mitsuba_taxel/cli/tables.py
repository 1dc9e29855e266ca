"""Text output of the subcommands: tables on stdout, progress on stderr."""

from __future__ import annotations

import json
import math
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

if TYPE_CHECKING:
    from mitsuba_taxel.base.files.printed import Printed


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of numbers on the standard output; the first column is aligned left, the others right."""
    from mitsuba_taxel.base.files.text_table import text_table

    say(text_table(headings, rows, terminal_width()))


def say(text: str = "") -> None:
    """Print lines on stdout, folded between words in a terminal; lines are left whole in a pipe."""
    width = terminal_width()
    for line in text.split("\n"):
        if width is not None and len(line) > width:
            line = textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False)
        print(line)


def terminal_width() -> int | None:
    """Width of the terminal in characters; None in a pipe, where lines are not wrapped."""
    console = Console()
    return console.width if console.is_terminal else None


def print_text_table(headings: Sequence[str], rows: Iterable[Sequence[str]], width: int | None = None) -> None:
    """Print a table of text on the standard output; only its last column is wrapped, in a pipe only if a width is
    given.
    """
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(heading, no_wrap=heading != headings[-1])
    for row in rows:
        table.add_row(*row)
    if width is None:
        _show(table)
    else:
        Console(highlight=False, markup=False, color_system=None, width=width).print(table)


def text_width() -> int:
    """Width of a line of prose: that of the terminal, at most 120 characters, or 100 without a terminal."""
    console = Console()
    return min(console.width, 120) if console.is_terminal else 100


def end_beyond_target(notes: Iterable[str]) -> None:
    """End the program with exit code 3 if notes state that a target was not reached or that scenes have no reading yet.
    These notes are repeated on stderr."""
    missed = [note for note in notes if re.search("target (error|slope) .* not reached|have no reading yet", note)]
    for note in missed:
        click.echo(f"taxel: {note}", err=True)
    if missed:
        raise click.exceptions.Exit(3)


def _show(table: Table) -> None:
    """Print a table without truncation: it is wrapped in a narrow terminal, but not in a pipe."""
    width = None if Console().is_terminal else 10_000
    console = Console(highlight=False, markup=False, color_system=None, width=width)
    if console.measure(table).maximum > console.width:
        for column in table.columns:
            column.no_wrap, column.overflow = False, "fold"
    console.print(table)


def print_figures(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of figures of merit, units below names; the title names the force if there is only one."""
    from mitsuba_taxel.base.files.printed import figures_table

    print_result([figures_table(title, headings, rows)] if rows else [])


def print_result(printed: Printed) -> None:
    """Print the tables and lines of a result, units below names, and warnings on stderr."""
    from mitsuba_taxel.base.files.printed import WARNING

    for number, block in enumerate(printed):
        if isinstance(block, str) and block.startswith(WARNING):
            click.echo(block, err=True)
            continue
        if isinstance(block, str):
            say(block)
            continue
        if block.title or number:
            say(f"\n{block.title}" if block.title and number else block.title)
        print_table([heading.replace(" [", "\n[") for heading in block.headings], block.rows)


def print_summary(taxels: Sequence[int], quantities: Mapping) -> None:
    """Print the least, mean and largest value of quantities (T,) by name, instead of a row for each taxel."""
    from .many_taxels import HEADINGS, summary_rows

    print_table(HEADINGS, summary_rows(taxels, quantities))


def circuit_in(file):
    """The circuit in a file; None without a file."""
    if file is None:
        return None
    from mitsuba_taxel.electronics import read_circuit

    return read_circuit(file)


def print_volts(taxels: Sequence[int], volts) -> None:
    """Print the output of the circuit of each taxel, and its derivatives with respect to parameters, in V and counts.

    Of many taxels, a summary is printed.
    """
    from .many_taxels import MOST_ROWS

    say("\nOutput of the circuit; noise: 1 sigma of the electronics")
    if len(taxels) > MOST_ROWS:
        outputs = {"voltage [V]": volts.voltage, "total error [V]": volts.error, "noise [V]": volts.noise}
        print_summary(taxels, outputs | {"counts": volts.counts})
        say(f"Saturated: {int(volts.saturated.sum())} of {len(taxels)} taxels")
    else:
        _print_outputs(taxels, volts)
    say(f"One count: {volts.step:.4g} V")
    for note in volts.notes:
        say(note)
    if volts.derivatives is not None and len(taxels) > MOST_ROWS:
        _print_derivative_summary(taxels, volts.derivatives)
    elif volts.derivatives is not None:
        _print_shown_derivatives(volts.derivatives)


def _print_outputs(taxels: Iterable[int], volts) -> None:
    """Print a row for the output of each taxel."""
    rows = zip(
        map(str, taxels),
        (f"{voltage:.6f}" for voltage in volts.voltage),
        (f"{error:.1e}" for error in volts.error),
        (f"{value:.2e}" for value in volts.noise),
        (
            f"{counts} saturated" if full else str(counts)
            for counts, full in zip(volts.counts, volts.saturated, strict=True)
        ),
        strict=True,
    )
    print_table(("taxel", "voltage [V]", "total error [V]", "noise [V]", "counts"), rows)


def _print_derivative_summary(taxels: Sequence[int], derivatives) -> None:
    """Print least, mean and largest derivatives in volts and counts, with noise and distance from saturation."""
    from .many_taxels import derivative_quantities

    in_volts = derivatives.in_volts
    quantities = derivative_quantities(in_volts)
    for number, (name, unit) in enumerate(zip(in_volts.parameters, in_volts.units, strict=True)):
        quantities[f"{name} [{unit.replace('V', 'counts', 1)}]"] = derivatives.counts[:, number]
        quantities[f"{name}, change that equals the noise"] = derivatives.noise_equivalent[:, number]
        quantities[f"{name}, change to saturation"] = derivatives.to_saturation[:, number]
    say("\nDerivatives of the output of the circuit")
    print_summary(taxels, quantities)


def _print_shown_derivatives(shown) -> None:
    """Print derivatives in volts and counts by parameter and taxel, with noise and distance from saturation."""
    from mitsuba_taxel.sensing.reading.derivative_values import derivatives_text

    say(f"\n{derivatives_text(shown.in_volts, terminal_width())}")
    say("\nIn counts; then the change of the parameter that equals the noise, and the change that saturates the output")
    rows = (
        (
            row["parameter"],
            str(row["taxel"]),
            row["unit"].replace("V", "counts", 1),
            *(f"{row[name]:.4g}" for name in ("counts", "noise_equivalent", "to_saturation")),
        )
        for row in shown.rows()
    )
    print_table(("parameter", "taxel", "unit", "derivative", "noise", "to saturation"), rows)


def print_pads(rows: Sequence[Mapping]) -> None:
    """Print deformed pads: how many there are and the largest error of their roofs, then their load and quality."""

    def number(value: float | None, form: str) -> str:
        return "unknown" if value is None else format(value, form)

    count = "1 deformed pad" if len(rows) == 1 else f"{len(rows)} deformed pads"
    errors = [(row["roof_error_mm"], row["slope_error_degrees"]) for row in rows]
    if all(None not in pair for pair in errors):
        height, slope = (max(column) for column in zip(*errors, strict=True))
        say(f"{count}: the error of the roofs is {height:.1e} mm and {slope:.2f} degrees.\n")
    else:
        say(f"{count}: the error of the roofs is unknown.\n")
    quantity, unit = rows[0]["quantity"], rows[0]["unit"]
    headings = ("file", f"{quantity} [{unit}]", "min J", "residual", "stable", "roof error [mm]", "slope error [deg]")
    print_table(
        headings,
        (
            (
                row["file"],
                ", ".join(f"{component:g}" for component in row["value"]),
                f"{row['min_jacobian']:.4f}",
                f"{row['residual']:.0e}",
                "yes" if row["stable"] else "not checked",
                number(row["roof_error_mm"], ".1e"),
                number(row["slope_error_degrees"], ".2f"),
            )
            for row in rows
        ),
    )
    timed = [row for row in rows if row["time_s"] is not None]
    if timed:
        first, last, error = timed[0]["time_s"], timed[-1]["time_s"], max(row["time_error"] for row in timed)
        say(f"From {first:.4g} s to {last:.4g} s; the time steps cause a relative error of the stress of {error:.0e}.")
    worst = max(row["imbalance"] for row in rows)
    say(f"Reaction of the board and load differ by {worst:.0e} of the load at most.")
    if quantity == "displacement":
        say("Force by which the board holds the pad, in N:")
        for row in rows:
            force = ", ".join(f"{component:.4g}" for component in row["board_force_N"])
            say(f"{row['file']}: ({force}) +- {number(row['board_force_error_N'], '.1g')}")


def print_json(answer: object) -> None:
    """Print an object on stdout, as JSON."""
    click.echo(json.dumps(answer))


def known(number: float) -> float | None:
    """Replace a number that is not finite by None, because JSON supports finite numbers only."""
    return None if isinstance(number, float) and not math.isfinite(number) else number


def records(table) -> list[dict[str, object]]:
    """The rows of a data frame as dictionaries for JSON, None for numbers that are not finite."""
    return [{name: known(value) for name, value in row.items()} for row in table.to_dict("records")]


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """Create a function (done, total) that moves a bar on stderr, or does nothing if stderr is not a terminal.

    The current activity, such as meshing, stands beside the bar.
    """
    from mitsuba_taxel.base.processes.activities import announced_to

    with _bar() as bar:
        task = bar.add_task(what, total=None, activity="")
        with announced_to(lambda words: bar.update(task, activity=words)):
            yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def study_bar() -> Iterator[Callable]:
    """Create a function that shows a study's ``Progress`` on a terminal: jobs, time left and error so far."""
    from mitsuba_taxel.base.processes.activities import announced_to
    from mitsuba_taxel.base.units import in_percent

    with _bar() as bar:
        task = bar.add_task("readings", total=None, activity="")

        def show(progress) -> None:
            failed = f", {progress.failed} failed" if progress.failed else ""
            words = f"readings (error {in_percent(progress.error)}{failed})"
            bar.update(task, completed=progress.done, total=progress.total, description=words)

        with announced_to(lambda words: bar.update(task, activity=words)):
            yield show


def _bar() -> Progress:
    """Create a progress bar on stderr; it is hidden if stderr is not a terminal."""
    console = Console(file=sys.__stderr__)  # control characters move its cursor
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[activity]}"),
    )  # fmt: skip
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def print_notes(result) -> None:
    """Print the warnings of a result on stderr, and its notes on stdout."""
    for warning in result.warnings:
        click.echo(f"warning: {warning}", err=True)
    for note in result.notes:
        say(note)


def print_left_out(lines: Sequence[str]) -> None:
    """Print which computations were omitted because a scene does not need them, one line each."""
    say("\nLeft out of this scene:")
    for line in lines:
        say(f"  {line}")
