"""Commands where what only Linux has is missing, as on Windows and on macOS: modules, calls, names of files.

Compiled libraries remain those of this machine: what they do on another system is not tested here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import mitsuba_taxel.scenes

IMITATED = Path(__file__).parent / "helpers" / "imitated"
RUN = """
import json, sys, types
import taxel_cli
for arguments in json.loads(sys.argv[1]):
    print(*arguments, file=sys.stderr, flush=True)
    status = taxel_cli.taxel.main(arguments, obj=types.SimpleNamespace(debug=True, ended=[]), standalone_mode=False)
    assert not status, status
"""


def run(system: str, folder: Path, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python code as on a system, in a folder, with an empty cache of solutions there."""
    environment = {
        **os.environ, "IMITATED": system, "PYTHONPATH": str(IMITATED), "PYTHONWARNDEFAULTENCODING": "1",
        "OMP_NUM_THREADS": "1", "MITSUBA_TAXEL_CACHE": str(folder / "cache"),
    }  # fmt: skip
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


COMMANDS = """
render gel.xml -D uz=-0.05 -D width=32 -D height=24 --points 16 -o gel.exr
render hexagonal.xml --points 16 -o hexagonal.exr
deform pad.xml -o pad.vtu
sweep plate.xml --vary z=0.5:1:0.5 --points 64 --workers 2 -o runs
report runs -o report.html
"""


@pytest.mark.parametrize("system", ["Windows", "macOS"])
def test_commands_run_as_on_other_systems(tmp_path, system):
    """All shipped scenes: a camera's image of a pressed pad, a map of a pad from a file, which a process of its own
    meshes, the mesh of a pad, a study in two processes, and a report on it. Each is as small as it can be: what a
    system lacks is missing in small ones, too. Windows lacks more than macOS, which gets the commands that start
    processes, and the mesh."""
    scenes = {file.name for folder in mitsuba_taxel.scenes.__path__ for file in Path(folder).glob("*.xml")}
    commands = [line.split() for line in COMMANDS.strip().splitlines()]
    assert scenes == {word for command in commands for word in command if word.endswith(".xml")}
    if system == "macOS":
        commands = [command for command in commands if command[1] in ("hexagonal.xml", "pad.xml", "plate.xml")]
    done = run(system, tmp_path, RUN, json.dumps(commands))
    assert done.returncode == 0, done.stderr
    assert all((tmp_path / command[-1]).exists() for command in commands)


MESH = """
import numpy as np
from mitsuba_taxel.pads.imported.isolated_process import run_isolated
corners, faces = np.eye(4, 3), np.array([[0, 3, 1], [1, 3, 2], [2, 3, 0], [0, 1, 2]])
print(len(run_isolated("fill", {"vertices": corners, "triangles": faces, "mesh_size": 0.5})["tets"]))
"""


def test_the_process_that_meshes_runs_as_on_macos(tmp_path):
    """It asks most of the system."""
    done = run("macOS", tmp_path, MESH)
    assert (done.returncode, done.stdout.strip()) == (0, "1"), done.stderr  # one tetrahedron is filled by one


FORBIDDEN = """
import os, signal, sys
import mitsuba_taxel.base.processes.system as system
for name in ("resource", "fcntl"):
    try:
        exec(f"import {name}", vars(system))
    except ModuleNotFoundError:
        continue
    print(name)
for text in (
    "os.fork", "signal.alarm", "signal.SIGHUP", "os.symlink('a', 'b')", "open('a:b', 'w')", "os.kill(1, 0)",
    "open('/dev/null')", "ctypes.CDLL(None).prctl",
):
    try:
        exec(f"import ctypes, os, signal; {text}", vars(system))
    except (AttributeError, OSError, TypeError):
        continue
    print(text)
open("name", "w").close()
try:
    open("Name", "w")
except FileExistsError:
    pass
else:
    print("capital letters")
"""


def test_the_imitation_refuses_what_it_should(tmp_path):
    done = run("Windows", tmp_path, FORBIDDEN)
    assert (done.returncode, done.stdout) == (0, ""), done.stdout + done.stderr
    done = run("macOS", tmp_path, FORBIDDEN)
    assert done.stdout.split("\n")[:2] == ["resource", "fcntl"] and "capital letters" not in done.stdout, done.stderr
