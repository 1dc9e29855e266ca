"""Fixtures of the tests of light without random numbers."""

from __future__ import annotations

import pytest

from mitsuba_taxel.backend import llvm


@pytest.fixture(autouse=True, scope="session")
def llvm_that_renders():
    """Without one, as on a machine with a graphics card alone, an array of Dr.Jit's for LLVM ends the process."""
    if not llvm.is_fit():
        pytest.skip(f"light without random numbers needs an LLVM of version {llvm.OLDEST_LLVM} or newer")
