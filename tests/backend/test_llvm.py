"""The choice of LLVM, each in a fresh process, since it is made once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from mitsuba_taxel.backend import llvm

RENDER = (
    "mi.set_variant('llvm_ad_mono');"
    "r = mt.measure(mt.Scene.from_file('plate.xml', scattering='lambertian'), points=256);"
    "assert 0.01 < r.power[0] < 0.02;"
    "import drjit as dr; print(dr.detail.llvm_version()[0])"
)


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """``code`` where nothing but ``environment`` chooses a library; on CPUs, as these use one, unless it says else."""
    clean = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    clean["MITSUBA_TAXEL_VARIANT"] = "llvm_ad_mono"
    return subprocess.run([sys.executable, "-c", code], env={**clean, **environment}, capture_output=True, text=True)


def test_imported_first_it_renders():
    done = python(f"import mitsuba_taxel as mt, mitsuba as mi; {RENDER}")
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= llvm.OLDEST_LLVM


def unfit_library() -> str | None:
    """An LLVM on this machine that would abort, if there is one."""
    for path in sorted(Path("/usr/lib/x86_64-linux-gnu").glob("libLLVM-1[56].so*")):
        return str(path)
    return None


@pytest.mark.parametrize("code", ["import mitsuba, mitsuba_taxel", "import drjit, mitsuba_taxel"])
def test_unfit_library_already_loaded_is_refused_in_one_line(code):
    unfit = unfit_library()
    if unfit is None:
        pytest.skip("no unfit LLVM on this machine to be refused")
    done = python(code, DRJIT_LIBLLVM_PATH=unfit)
    assert done.returncode == 1
    message = done.stderr.strip().splitlines()[-1]
    assert message.startswith("ImportError: Dr.Jit has loaded LLVM 1")
    assert "import mitsuba_taxel before mitsuba" in message and "DRJIT_LIBLLVM_PATH" in message


def test_a_path_that_leads_nowhere_is_named():
    done = python("import mitsuba_taxel", DRJIT_LIBLLVM_PATH="/nowhere/libLLVM.so")
    assert done.returncode == 1
    assert done.stderr.strip().splitlines()[-1].startswith("ImportError: DRJIT_LIBLLVM_PATH = '/nowhere/libLLVM.so'")


def test_a_variant_that_uses_none_needs_none():
    """With a graphics card, until one that does is set."""
    code = "import mitsuba_taxel, mitsuba as mi; from mitsuba_taxel.backend import llvm; print(llvm.is_fit())"
    code += "; mi.set_variant('llvm_ad_mono')"
    done = python(code, DRJIT_LIBLLVM_PATH="/nowhere/libLLVM.so", MITSUBA_TAXEL_VARIANT="cuda_ad_mono")
    assert done.stdout.strip() == "False" and done.returncode == 1
    message = done.stderr.strip().splitlines()[-1]
    assert message.startswith("ImportError: ") and "DRJIT_LIBLLVM_PATH" in message


def test_mitsuba_imported_first_renders_or_is_refused():
    done = python(f"import mitsuba as mi, mitsuba_taxel as mt; {RENDER}")
    if done.returncode:
        assert done.stderr.strip().splitlines()[-1].startswith("ImportError: Dr.Jit has loaded LLVM")
    else:
        assert int(done.stdout) >= llvm.OLDEST_LLVM


def test_the_users_choice_is_kept():
    done = python(
        "import os; before = os.environ['DRJIT_LIBLLVM_PATH'];"
        "from mitsuba_taxel.backend.llvm import choose_llvm;"
        "assert os.environ['DRJIT_LIBLLVM_PATH'] == before",
        DRJIT_LIBLLVM_PATH=str(llvm._packaged_library() or llvm._newest(llvm._system_libraries())),
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "name, version",
    [
        ("libLLVM.so.23.1", 23),
        ("libLLVM-19.so.1", 19),
        ("libLLVM-15.so", 15),
        ("libLLVM.so.19.1.7", 19),
        ("libLLVM.dylib", 0),
        ("libLLVMSupport.a", 0),
    ],
)
def test_version_in_library_name(name, version):
    assert llvm._version(Path(name)) == version


def test_a_library_states_its_version(tmp_path):
    library = llvm._packaged_library() or llvm._newest(llvm._system_libraries())
    assert library is not None
    assert llvm._asked_version(library) == llvm._version(library) >= llvm.OLDEST_LLVM
    (tmp_path / "LLVM-C.dll").write_bytes(b"no library")
    assert llvm._asked_version(tmp_path / "LLVM-C.dll") == 0


def test_a_library_without_a_version_in_its_name_is_asked(tmp_path, monkeypatch):
    """As LLVM is called on Windows and by Homebrew."""
    versions = {"LLVM-C.dll": 18, "libLLVM.dylib": 22, "libLLVM.so": 20, "libLLVM-21.so": 0, "libLLVMSupport.a": 99}
    monkeypatch.setattr(llvm, "_asked_version", lambda path: versions[path.name])
    files = [tmp_path / name for name in versions]
    for file in files:
        file.touch()
    assert [llvm._version(file) for file in files] == [18, 22, 20, 21, 0]
    assert llvm._newest(files) == tmp_path / "libLLVM.dylib"


@pytest.mark.parametrize(
    "place",
    [
        "opt/llvm/lib/libLLVM.dylib",
        "opt/llvm@20/lib/libLLVM.dylib",
        "lib/llvm-19/lib/libLLVM-19.so.1",
        "lib/libLLVM.so.23.1",
    ],
)
def test_libraries_are_found_in_folders_of_systems(tmp_path, monkeypatch, place):
    library = tmp_path / place
    library.parent.mkdir(parents=True)
    library.touch()
    folders = [f"{tmp_path}/{folder}" for folder in ("opt/llvm*/lib", "lib/llvm-*/lib", "lib")]
    monkeypatch.setattr(llvm, "_FOLDERS", folders)
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "none"))
    assert library in llvm._system_libraries()


def test_on_windows_programs_and_the_path_are_searched(tmp_path, monkeypatch):
    places = [tmp_path / "LLVM" / "bin", tmp_path / "tools", tmp_path / "env" / "Library" / "bin"]
    for place in places:
        place.mkdir(parents=True)
        (place / "LLVM-C.dll").touch()
    for name, value in (("ProgramFiles", tmp_path), ("PATH", f"relative{os.pathsep}{places[1]}")):
        monkeypatch.setenv(name, str(value))
    windows = SimpleNamespace(platform="win32", prefix=str(tmp_path / "env"), executable=sys.executable)
    monkeypatch.setattr(llvm, "sys", windows)
    assert {library.parent for library in llvm._system_libraries()} == set(places)
    assert "winget install LLVM.LLVM" in llvm.remedy()


@pytest.mark.parametrize("system, how", [("linux", "apt install libllvm19"), ("darwin", "brew install llvm")])
def test_the_remedy_is_that_of_the_system(monkeypatch, system, how):
    monkeypatch.setattr(llvm, "sys", SimpleNamespace(platform=system))
    assert how in llvm.remedy() and "DRJIT_LIBLLVM_PATH" in llvm.remedy()


def test_a_missing_library_of_the_system_is_named(tmp_path):
    """As Dr.Jit fails where it is missing: its extension cannot be loaded, and then its name is unknown."""
    (tmp_path / "drjit").mkdir()
    (tmp_path / "drjit" / "__init__.py").write_text(
        "try:\n    raise ImportError('libatomic.so.1: cannot open shared object file')\n"
        "except ImportError:\n    _drjit_ext\n"
    )
    done = python("import mitsuba_taxel", PYTHONPATH=str(tmp_path))
    assert done.returncode == 1
    message = done.stderr.strip().splitlines()[-1]
    assert message.startswith("ImportError: Dr.Jit cannot be imported (libatomic.so.1: ") and "libatomic1" in message


def test_import_is_light():
    """Importing the package brings mitsuba and nothing else heavy."""
    done = python(
        "import sys, mitsuba_taxel;"
        "heavy = {'scipy', 'netgen', 'trimesh', 'matplotlib', 'xarray', 'pandas', 'dask', 'rich', 'rslab'};"
        "print(*(heavy & set(sys.modules)))"
    )
    assert done.stdout.strip() == "", done.stdout + done.stderr


ADDS_NOTHING = "define i32 @f(i32 %x) { %y = add i32 %x, 0 ret i32 %y }"
SIMPLIFIED = f"""
import ctypes, os, sys
library = ctypes.CDLL(os.environ["DRJIT_LIBLLVM_PATH"])
pointer, text = ctypes.c_void_p, {ADDS_NOTHING.encode()!r}
for name in ("ContextCreate", "CreateMemoryBufferWithMemoryRangeCopy", "CreatePassBuilderOptions"):
    getattr(library, "LLVM" + name).restype = pointer
library.LLVMPrintModuleToString.restype = ctypes.c_char_p
buffer = library.LLVMCreateMemoryBufferWithMemoryRangeCopy(text, ctypes.c_size_t(len(text)), b"f")
module, message = pointer(), pointer()
context = pointer(library.LLVMContextCreate())
library.LLVMParseIRInContext(context, pointer(buffer), ctypes.byref(module), ctypes.byref(message))
options = pointer(library.LLVMCreatePassBuilderOptions())
library.LLVMRunPasses(module, b"instcombine", None, options)
print(b"add" not in library.LLVMPrintModuleToString(module))
"""


@pytest.mark.parametrize("imported, simplified", [("mitsuba_taxel", "False"), ("drjit", "True")])
def test_optional_passes_are_skipped_once_the_package_is_imported(imported, simplified):
    done = python(f"import {imported}\n{SIMPLIFIED}", DRJIT_LIBLLVM_PATH=os.environ["DRJIT_LIBLLVM_PATH"])
    assert done.stdout.strip() == simplified and not done.stderr
