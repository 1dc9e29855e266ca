"""`taxel optimise`: the best design within bounds and constraints."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from ..options import on_a_study_file, retry_option


@click.command(short_help="The best design of a scene within bounds and constraints.")
@retry_option
@on_a_study_file
def command(
    source: Path, folder: Path, workers: int | None, scheduler: str | None, retry_failed: bool, as_json: bool
) -> None:
    """Find the best design as defined by the table [optimise] of STUDY.toml, by gradients of the whole chain.

    Each load of each design is stored in DIR as soon as it is computed; the same command resumes an interrupted run.
    Tables, a plot, a page optimum.md, the best design as a scene, and drawings of its pad and mould are written to DIR.
    """
    from mitsuba_taxel.optimum import optimise
    from mitsuba_taxel.optimum.outputs import printed_optimum

    from ..tables import print_json, print_result, say

    with _best_so_far() as progress:
        result = optimise(
            source, folder, workers=workers, scheduler=scheduler, retry_failed=retry_failed, progress=progress
        )
    if as_json:
        print_json({**_as_json(result), "output": str(folder)})
        return
    print_result(printed_optimum(result))
    say(f"Results: {folder}")


@contextmanager
def _best_so_far() -> Iterator[Callable]:
    """Create a function that shows an optimisation's progress (``OptimisationProgress``) on a terminal."""
    from rich.console import Console

    console = Console(file=sys.__stderr__)
    if not console.is_terminal:
        yield lambda progress: None
        return
    with console.status("design 1") as status:

        def show(progress) -> None:
            failed = f", {progress.failed} failed" if progress.failed else ""
            status.update(f"{progress.designs} designs{failed}; best so far: {progress.best or 'none allowed'}")

        yield show


def _as_json(result) -> dict[str, object]:
    from ..tables import known, records

    tables = {"figures", "variables", "slopes", "history", "front"}
    shown: dict[str, object] = {}
    for name, value in vars(result).items():
        if name in tables:
            value = records(value)
        shown[name] = known(value) if isinstance(value, float) else value
    return shown
