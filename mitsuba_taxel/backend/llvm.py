"""Selection of an LLVM that works, before Dr.Jit selects a version that does not.

Dr.Jit 1.5 uses any LLVM on the system. It refuses version 14 with an exception, but versions 15 and 16 abort the
process at the first render (``Cannot select: fminimum``). The library is fixed when mitsuba is imported.
"""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from mitsuba_taxel.base.caches import kept

OLDEST_LLVM = 19
"""Oldest major version that is known to render (19, 22 and 23 were tested)."""

_LIBRARIES = ("libLLVM*", "LLVM-C.dll")
_FOLDERS = (
    "/usr/lib/x86_64-linux-gnu",  # Debian, Ubuntu
    "/usr/lib/aarch64-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",  # Fedora, openSUSE
    "/usr/lib64/llvm*/lib",
    "/usr/lib",  # Arch
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",  # Homebrew on Apple's processors, and on Intel's
    "/usr/local/opt/llvm*/lib",
    "/opt/local/libexec/llvm-*/lib",  # MacPorts
)
"""Folders in which systems and package managers keep LLVM. On Windows these are others: see `_folders`."""
_INSTALL = {
    "linux": "apt install libllvm19 (Debian, Ubuntu), dnf install llvm-libs (Fedora), pacman -S llvm-libs (Arch)",
    "darwin": "brew install llvm",
    "win32": "winget install LLVM.LLVM",
}
"""How LLVM is installed, by system."""
_VERSION = """
import ctypes, sys
version = [ctypes.c_uint() for _ in range(3)]
ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*map(ctypes.byref, version))
print(version[0].value)
"""


def choose_llvm() -> None:
    """Set ``DRJIT_LIBLLVM_PATH`` to a suitable LLVM, unless the user has set it or Dr.Jit is already loaded."""
    if "drjit" in sys.modules or os.environ.get("DRJIT_LIBLLVM_PATH"):
        return
    library = _packaged_library() or _newest(_system_libraries())
    if library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)


def load_drjit() -> None:
    """Import Dr.Jit.

    Raises
    ------
    ImportError
        in one line, if a library of the system is missing, such as libatomic in small containers.
    """
    try:
        import drjit  # noqa: F401
    except (ImportError, NameError) as error:
        # Dr.Jit fails while it formats its own message.
        reason = error.__context__ if isinstance(error, NameError) else error
        raise ImportError(
            f"Dr.Jit cannot be imported ({reason}): install that library (libatomic: apt install libatomic1, or dnf "
            "install libatomic)."
        ) from error


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
        raise ImportError(f"Dr.Jit has loaded LLVM {loaded_version}, which aborts at the first render: {remedy()}.")
    if loaded and chosen:
        _skip_optional_passes(chosen)


@kept(None)
def _skip_optional_passes(library: str) -> None:
    """Halve the time of compiling kernels by skipping the optional passes of LLVM.

    The code that Dr.Jit generates is vectorised and contains no dead code already. Results keep all their digits.
    Random paths take up to 5 % longer, which exceeds the savings only in long runs. Neither LLVM nor Dr.Jit has a
    function for this. Therefore an option is used with which LLVM's developers search for faulty passes; versions of
    LLVM without this option ignore it.
    """
    options = (b"mitsuba_taxel", b"-opt-bisect-verbose=0", b"-opt-bisect-limit=0")
    parse = ctypes.CDLL(library).LLVMParseCommandLineOptions
    parse(len(options), (ctypes.c_char_p * len(options))(*options), None)


def is_fit() -> bool:
    """Whether Dr.Jit has loaded a suitable LLVM.

    If it has not, the process ends as soon as an array of an LLVM variant is created."""
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


def remedy() -> str:
    """Instructions to install an LLVM on this system, as text."""
    how = _INSTALL.get(sys.platform, _INSTALL["linux"])
    return (
        f"install LLVM {OLDEST_LLVM} or newer ({how}) and import mitsuba_taxel before mitsuba and drjit, or set "
        "DRJIT_LIBLLVM_PATH to its library"
    )


def _system_libraries() -> Iterable[Path]:
    """All libraries of LLVM in the usual folders of this system."""
    for pattern in _folders():
        anchor = Path(pattern).anchor
        for folder in sorted(Path(anchor).glob(pattern.removeprefix(anchor))):
            for name in _LIBRARIES:
                yield from folder.glob(name)


def _folders() -> list[str]:
    """Patterns of the folders that may hold LLVM: those of conda's environment and of the system."""
    if sys.platform != "win32":
        return [f"{sys.prefix}/lib", *_FOLDERS]
    programs = [os.environ.get(name) for name in ("ProgramFiles", "ProgramW6432")]
    searched = os.environ.get("PATH", "").split(os.pathsep)
    folders = [f"{sys.prefix}/Library/bin", *(f"{program}/LLVM/bin" for program in programs if program), *searched]
    return [folder for folder in folders if os.path.isabs(folder) and os.path.isdir(folder)]


def _newest(libraries: Iterable[Path]) -> Path | None:
    """Library of LLVM with the highest suitable version; None if no library is suitable."""
    fit = [(version, path) for path in libraries if path.exists() and (version := _version(path)) >= OLDEST_LLVM]
    return max(fit)[1] if fit else None


def _version(path: Path) -> int:
    """Major version of a library, 0 if that is not known.

    Most have it in their name (``libLLVM.so.23.1``, ``libLLVM-19.so.1``), or are links to such a name. Other libraries
    (``LLVM-C.dll``, Homebrew's ``libLLVM.dylib``) are loaded in a separate process, which may crash, to ask for their
    version.
    """
    for name in (path.name, path.resolve().name):
        match = re.fullmatch(r"libLLVM(?:-(\d+))?(?:\.\d+)*\.(?:so|dylib)(?:\.(\d+))?(?:\.\d+)*", name)
        if match and (match[1] or match[2]):
            return int(match[1] or match[2])
    return _asked_version(path) if path.name in ("libLLVM.so", "libLLVM.dylib", "LLVM-C.dll") else 0


def _asked_version(path: Path) -> int:
    """Major version of LLVM that a library states when a separate process loads it; 0 if it cannot be loaded, or is
    older than version 16.
    """
    asked = subprocess.run([sys.executable, "-I", "-S", "-c", _VERSION, str(path)], capture_output=True, text=True)
    return int(asked.stdout) if asked.returncode == 0 else 0
