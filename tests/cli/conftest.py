"""The installed `taxel` program, and what it does within this process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from taxel_program import run_program


@pytest.fixture
def program() -> str:
    """Path of the program."""
    return str(Path(sys.executable).with_name("taxel"))


@pytest.fixture
def taxel(tmp_path):
    """Run the program in an empty folder: ``taxel("render", "plate.xml")`` -> completed process with text."""

    def run(*words: object) -> subprocess.CompletedProcess:
        return run_program(tmp_path, *words)

    return run


@pytest.fixture
def taxel_process(program, tmp_path):
    """The same as a user runs it, in a process of its own."""

    def run(*words: object) -> subprocess.CompletedProcess:
        command = [program, *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)

    return run
