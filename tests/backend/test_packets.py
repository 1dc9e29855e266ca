"""Memory that kernels read beyond the end of an array."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from mitsuba_taxel.backend.packets import ALIGNMENT, PACKET, in_packets

pytestmark = pytest.mark.quick

AT_THE_END_OF_MEMORY = dedent("""
    import sys
    import numpy as np, mitsuba as mi, drjit as dr
    from guarded_memory import guarded
    from mitsuba_taxel.backend.packets import in_packets
    mi.set_variant("llvm_ad_mono")
    last = guarded(np.ones(1003, sys.argv[2]))
    print(dr.sum(getattr(mi, sys.argv[1])(eval(sys.argv[3])) + 1)[0])
""")
TESTS = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1] / "helpers")}


@pytest.mark.parametrize(("kind", "dtype"), [("Float", "float32"), ("Float64", "float64")])
@pytest.mark.parametrize(("given", "ends_well"), [("in_packets(last, last.dtype)", True), ("last", False)])
def test_numbers_before_a_page_that_may_not_be_read(llvm_mono, kind, dtype, given, ends_well):
    """If the second ends well too, Dr.Jit no longer reads beyond the end, and `in_packets` has had its day."""
    command = [sys.executable, "-c", AT_THE_END_OF_MEMORY, kind, dtype, given]
    done = subprocess.run(command, capture_output=True, text=True, env=TESTS)
    assert (done.returncode == 0) == ends_well, done.stderr
    assert not ends_well or float(done.stdout) == 2006


@pytest.mark.parametrize("values", [np.arange(5.0), np.arange(12).reshape(3, 4).T, np.ones(1), np.arange(7)[::-2]])
@pytest.mark.parametrize("dtype", [np.float32, np.uint32, np.float64])
def test_the_numbers_are_a_copy_in_whole_packets(values, dtype):
    copy = in_packets(values, dtype)
    assert copy.dtype == dtype and copy.tolist() == values.ravel().tolist()
    assert copy.ctypes.data % ALIGNMENT == 0 and not np.shares_memory(copy, values)
    buffer = copy
    while isinstance(buffer.base, np.ndarray):
        buffer = buffer.base
    whole = -(-copy.size // PACKET) * PACKET * copy.itemsize
    assert buffer.ctypes.data + buffer.nbytes >= copy.ctypes.data + whole
