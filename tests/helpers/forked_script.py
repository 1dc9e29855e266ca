"""Scripts in processes that are forked from one that has imported what most of them do: two seconds less each."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from multiprocessing import get_context
from pathlib import Path

from cores import keep_to_share_of_cores

IMPORTED = (
    "dask.array", "distributed", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg",
    "matplotlib.figure", "mitsuba_taxel.fitting.run", "mitsuba_taxel.mechanics.load_paths",
    "mitsuba_taxel.optimum.run", "mitsuba_taxel.report.page.study_page", "mitsuba_taxel.tolerances.run", "netgen.occ",
    "scipy.io", "scipy.stats", "taxel_cli", "trimesh", "xarray",
)  # fmt: skip
"""None of these starts a thread that a fork would lack."""

_forks = get_context("forkserver")
_forks.set_forkserver_preload([*IMPORTED])


def run_script(script: Path, folder: Path, *words: object, **settings: str) -> subprocess.CompletedProcess:
    """What ``python SCRIPT WORDS`` in a folder comes to, with further variables of the environment."""
    output = folder.with_name(f"{folder.name}.output")
    command = [str(script), *map(str, words)]
    process = _forks.Process(target=_run, args=(command, folder, settings, output))
    process.start()
    process.join(300)
    if process.exitcode is None:
        process.kill()
    return subprocess.CompletedProcess(command, process.exitcode, output.read_text(encoding="utf-8"), "")


def _run(command: list[str], folder: Path, settings: dict[str, str], output: Path) -> None:
    with output.open("wb", buffering=0) as file:
        for descriptor in (1, 2):
            os.dup2(file.fileno(), descriptor)
    os.chdir(folder)
    os.environ.update(settings)
    keep_to_share_of_cores()
    sys.argv = command
    sys.path.insert(0, str(Path(command[0]).parent))
    runpy.run_path(command[0], run_name="__main__")
