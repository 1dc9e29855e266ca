"""The `taxel` program in an empty folder."""

from __future__ import annotations

import pytest
from taxel_program import run_program


@pytest.fixture
def taxel(tmp_path):
    """Run the program: ``taxel("fit", "study.toml")`` -> completed process with text."""
    return lambda *words: run_program(tmp_path, *words)
