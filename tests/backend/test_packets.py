"""Memory that kernels read beyond the end of an array."""

from __future__ import annotations

import subprocess
import sys
from textwrap import dedent

import numpy as np
import pytest

from mitsuba_taxel.backend.packets import PACKET, in_packets

AT_THE_END_OF_MEMORY = dedent("""
    import ctypes, mmap, sys
    import numpy as np, mitsuba as mi, drjit as dr
    from mitsuba_taxel.backend.packets import in_packets
    mi.set_variant("llvm_ad_mono")
    page, libc = mmap.PAGESIZE, ctypes.CDLL(None)
    libc.mmap.restype, libc.mprotect.argtypes = ctypes.c_void_p, (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    first = libc.mmap(None, ctypes.c_size_t(2 * page), 3, 0x22, -1, ctypes.c_long(0))
    assert libc.mprotect(first + page, page, 0) == 0
    last = np.frombuffer((ctypes.c_float * 1003).from_address(first + page - 4 * 1003), np.float32)
    last[:] = 1
    print(dr.sum(mi.Float(eval(sys.argv[1])) + 1)[0])
""")


@pytest.mark.parametrize(("given", "ends_well"), [("in_packets(last)", True), ("last", False)])
def test_numbers_before_a_page_that_may_not_be_read(llvm_mono, given, ends_well):
    """If the second ends well too, Dr.Jit no longer reads beyond the end, and `in_packets` has had its day."""
    done = subprocess.run([sys.executable, "-c", AT_THE_END_OF_MEMORY, given], capture_output=True, text=True)
    assert (done.returncode == 0) == ends_well, done.stderr
    assert not ends_well or float(done.stdout) == 2006


@pytest.mark.parametrize("values", [np.arange(5.0), np.arange(12).reshape(3, 4).T, np.ones(1), np.arange(7)[::-2]])
@pytest.mark.parametrize("dtype", [np.float32, np.uint32])
def test_the_numbers_are_a_copy_in_whole_packets(values, dtype):
    copy = in_packets(values, dtype)
    assert copy.dtype == dtype and copy.tolist() == values.ravel().tolist()
    assert copy.ctypes.data % PACKET == 0 and not np.shares_memory(copy, values)
    buffer = copy
    while isinstance(buffer.base, np.ndarray):
        buffer = buffer.base
    whole = -(-copy.nbytes // PACKET) * PACKET
    assert buffer.ctypes.data + buffer.nbytes >= copy.ctypes.data + whole
