"""The random seed of fTetWild, fixed by a patch of the machine code of this process's C++ library.

fTetWild inserts triangles in an order drawn from ``std::random_device`` and offers no seed, so every run would give a
different mesh and reading. In the process that meshes, the function behind ``std::random_device`` (``_M_getval`` of
libstdc++, Itanium ABI) is overwritten by one that returns a constant. Nothing else is changed, and the process ends
with its task. On other processors, other C++ libraries, or where the system allows no writing to code, nothing is
patched and meshes differ from run to run.
"""

from __future__ import annotations

import ctypes
import mmap
import platform

CONSTANT_42 = {
    "x86_64": bytes.fromhex("f30f1efa b82a000000 c3"),  # endbr64; mov eax, 42; ret
    "aarch64": bytes.fromhex("40058052 c0035fd6"),  # mov w0, 42; ret
}
"""Machine code of a function that returns 42, by processor."""


def fix_random_device() -> None:
    """Make ``std::random_device`` return 42 in this process, if possible."""
    code = CONSTANT_42.get(platform.machine())
    if code is None:
        return
    try:
        function = ctypes.CDLL("libstdc++.so.6")._ZNSt13random_device9_M_getvalEv
    except (OSError, AttributeError):
        return
    address = ctypes.cast(function, ctypes.c_void_p).value or 0
    start = address - address % mmap.PAGESIZE
    length = ctypes.c_size_t(address + len(code) - start)
    protect = ctypes.CDLL(None).mprotect
    if protect(ctypes.c_void_p(start), length, mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC) == 0:
        ctypes.memmove(address, code, len(code))
        protect(ctypes.c_void_p(start), length, mmap.PROT_READ | mmap.PROT_EXEC)
