"""fTetWild's package with two additions, in the process that meshes: a fixed seed, and an import without PyVista.

The newest version (0.4.2) offers no other way to obtain them. Nothing else is changed, and the process ends with its
task.

- fTetWild inserts triangles in an order drawn from ``std::random_device`` and has no seed, so every run would give a
  different mesh and reading. The function behind ``std::random_device`` (``_M_getval`` of libstdc++, Itanium ABI) is
  overwritten by a function that returns a constant: a patch of the machine code of this process's C++ library. On other
  processors, with other C++ libraries (macOS, Windows), or where the system allows no writing to code, nothing is
  patched, and meshes differ from run to run.
- It states that PyVista is optional, but imports it to register an accessor, for which it needs no more than the
  module. PyVista brings VTK, hundreds of MB; an empty module stands in for it.
"""

from __future__ import annotations

import ctypes
import platform
import sys
import types
from typing import Any

CONSTANT_42 = {
    "x86_64": bytes.fromhex("f30f1efa b82a000000 c3"),  # endbr64; mov eax, 42; ret
    "aarch64": bytes.fromhex("40058052 c0035fd6"),  # mov w0, 42; ret
}
"""Machine code of a function that returns 42, by processor."""


def fix_random_device() -> bool:
    """Make ``std::random_device`` return 42 in this process, if possible.

    Returns
    -------
    bool
        Whether it returns 42 now.
    """
    code = CONSTANT_42.get(platform.machine()) if sys.platform == "linux" else None
    if code is None:
        return False
    import mmap

    try:
        function = ctypes.CDLL("libstdc++.so.6")._ZNSt13random_device9_M_getvalEv
    except (OSError, AttributeError):
        return False
    address = ctypes.cast(function, ctypes.c_void_p).value or 0
    start = address - address % mmap.PAGESIZE
    length = ctypes.c_size_t(address + len(code) - start)
    protect = ctypes.CDLL(None).mprotect
    if protect(ctypes.c_void_p(start), length, mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC) != 0:
        return False
    ctypes.memmove(address, code, len(code))
    protect(ctypes.c_void_p(start), length, mmap.PROT_READ | mmap.PROT_EXEC)
    return True


def tetrahedralize(*args: Any, **kwargs: Any) -> Any:
    """The function ``pytetwild.tetrahedralize``, with a fixed seed if possible."""
    fix_random_device()
    sys.modules["pyvista"] = types.ModuleType("pyvista")
    import pytetwild

    return pytetwild.tetrahedralize(*args, **kwargs)
