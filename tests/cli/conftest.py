"""The installed `taxel` program, run as a user runs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture
def program() -> str:
    """Path of the program."""
    return str(Path(sys.executable).with_name("taxel"))


@pytest.fixture
def taxel(program, tmp_path):
    """Run the program in an empty folder: ``taxel("render", "plate.xml")`` -> completed process with text."""

    def run(*words: object) -> subprocess.CompletedProcess:
        command = [program, *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)

    return run
