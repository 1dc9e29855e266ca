"""Selection of an LLVM that works, before Dr.Jit selects a version that does not.

Dr.Jit 1.5 uses any LLVM on the system. It refuses version 14 with an exception, but versions 15 and 16 abort the
process at the first render (``Cannot select: fminimum``). The library is fixed when mitsuba is imported.
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from mitsuba_taxel.base.caches import kept

OLDEST_LLVM = 19
"""Oldest major version that is known to render (19, 22 and 23 were tested)."""

_SYSTEM_FOLDERS = (
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
    "/usr/lib64",
    "/usr/lib",
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm/lib",
    "/usr/local/opt/llvm/lib",
)
_REMEDY = (
    "import mitsuba_taxel before mitsuba and drjit, or set DRJIT_LIBLLVM_PATH to a libLLVM "
    f"of version {OLDEST_LLVM} or newer"
)


def choose_llvm() -> None:
    """Set ``DRJIT_LIBLLVM_PATH`` to a suitable LLVM, unless the user has set it or Dr.Jit is already loaded."""
    if "drjit" in sys.modules or os.environ.get("DRJIT_LIBLLVM_PATH"):
        return
    library = _packaged_library() or _newest(_system_libraries())
    if library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)


def check_llvm(variant: str) -> None:
    """Raise for an LLVM that would abort the process at the first render, if a variant uses LLVM.

    Parameters
    ----------
    variant : str
        Name of a variant of Mitsuba.

    Raises
    ------
    ImportError
        if Dr.Jit has loaded an LLVM older than :data:`OLDEST_LLVM`, or ``DRJIT_LIBLLVM_PATH`` is not an LLVM.
    """
    if not variant.startswith("llvm"):
        return
    import drjit as dr

    version = dr.detail.llvm_version()
    loaded = bool(version) and version[0] > 0
    chosen = os.environ.get("DRJIT_LIBLLVM_PATH")
    if not loaded and chosen:
        raise ImportError(
            f"DRJIT_LIBLLVM_PATH = {chosen!r} cannot be loaded: a libLLVM of version {OLDEST_LLVM} or newer is needed."
        )
    if loaded and version[0] < OLDEST_LLVM:
        loaded_version = ".".join(map(str, version))
        raise ImportError(f"Dr.Jit has loaded LLVM {loaded_version}, which aborts at the first render: {_REMEDY}.")
    if loaded and chosen:
        _skip_optional_passes(chosen)


@kept(None)
def _skip_optional_passes(library: str) -> None:
    """Halve the time of compiling kernels by skipping the optional passes of LLVM.

    The code that Dr.Jit generates is vectorised and contains no dead code already. Results keep all their digits.
    Random paths take up to 5 % longer, which exceeds the savings only in long runs. Neither LLVM nor Dr.Jit has a
    function for this, so the option is used with which LLVM's developers search for a faulty pass; an LLVM without that
    option ignores it.
    """
    options = (b"mitsuba_taxel", b"-opt-bisect-verbose=0", b"-opt-bisect-limit=0")
    parse = ctypes.CDLL(library).LLVMParseCommandLineOptions
    parse(len(options), (ctypes.c_char_p * len(options))(*options), None)


def is_fit() -> bool:
    """Whether Dr.Jit has loaded a suitable LLVM; without it, an array of an LLVM variant ends the process."""
    import drjit as dr

    version = dr.detail.llvm_version()
    return bool(version) and version[0] >= OLDEST_LLVM


def _packaged_library() -> Path | None:
    """The library of the package ``karellen-llvm-core``; None if it is not installed."""
    import importlib.metadata

    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    return _newest(Path(str(file.locate())).resolve() for file in files if file.name.startswith("libLLVM"))


def _system_libraries() -> Iterable[Path]:
    """All libraries of LLVM in the usual folders of the system."""
    for folder in (*_SYSTEM_FOLDERS, *map(str, Path("/usr/lib").glob("llvm-*/lib"))):
        yield from Path(folder).glob("libLLVM*")


def _newest(libraries: Iterable[Path]) -> Path | None:
    """The library of the highest suitable version, by its file name; None if there is none."""
    fit = [(version, path) for path in libraries if (version := _version(path)) >= OLDEST_LLVM and path.exists()]
    return max(fit)[1] if fit else None


def _version(path: Path) -> int:
    """Major version in the name of a library (``libLLVM.so.23.1``, ``libLLVM-19.so.1``); 0 without a version."""
    match = re.fullmatch(r"libLLVM(?:-(\d+))?(?:\.\d+)*\.(?:so|dylib)(?:\.(\d+))?(?:\.\d+)*", path.name)
    if match is None:
        return 0
    return int(match[1] or match[2] or 0)
