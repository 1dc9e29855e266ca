"""A scene is data: no library, and no module, that lies beside it or in the working directory runs."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.backend import libraries
from mitsuba_taxel.check import check_scene

LIBRARY = """
#include <stdio.h>
__attribute__((constructor)) static void run(void) { FILE *file = fopen("%s", "a"); if (file) fclose(file); }
"""
SCENE = """<scene version="3.9.0">
    <default name="shape" value="sphere"/>
    <path value="deeper"/>
    <integrator type="taxel_tracer"/>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
    <shape type="$shape"/>
</scene>"""


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> tuple[Path, Path]:
    """A shared library, and the file that it makes as soon as it is loaded."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no compiler")
    folder = tmp_path_factory.mktemp("library")
    source, built, marker = folder / "run.c", folder / "run.so", folder / "ran"
    source.write_text(LIBRARY % marker)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", built, source], check=True)
    return built, marker


@pytest.fixture
def unpacked(tmp_path, library) -> Path:
    """A scene with libraries named as plugins beside it, in the folder of a ``<path>``, and where it is read."""
    folder = tmp_path / "unpacked"
    for name, place in (
        ("sphere", folder),
        ("hdrfilm", folder),
        ("disk", folder / "deeper"),
        ("unknown", folder / "deeper"),
        ("foreign", folder),
        ("cube", tmp_path),
        ("worked", tmp_path),
    ):
        (place / "plugins").mkdir(parents=True, exist_ok=True)
        shutil.copy(library[0], place / "plugins" / f"{name}.so")
    (tmp_path / "multiprocessing.py").write_text(f"open({str(library[1])!r}, 'a')\n")
    (folder / "scene.xml").write_text(SCENE)
    return folder / "scene.xml"


def test_no_library_beside_a_scene_is_loaded(unpacked, library):
    """In a process of its own, as libraries are loaded once; Mitsuba's own shapes are those of its folder."""
    code = f"""
import mitsuba_taxel as mt
from mitsuba_taxel.check import check_scene
for shape in ("sphere", "disk", "cube", "unknown", "foreign", "worked", "unpacked/plugins/foreign", "../run", ""):
    findings = check_scene({str(unpacked)!r}, shape=shape)
    try:
        mt.Scene({str(unpacked)!r}, dict(shape=shape)).load()
        print(shape, "loaded", [f.severity for f in findings if f.severity == "error"])
    except mt.InputError as error:
        print(shape, "refused", str(error) in {{f.message for f in findings}})
mt.Scene(dict(type="scene", shape=dict(type="cylinder"))).load()
for shape in ("worked", "plugins/worked"):
    try:
        mt.Scene(dict(type="scene", shape=dict(type=shape))).load()
    except mt.InputError as error:
        print(shape, "refused")
"""
    folder = unpacked.parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert not library[1].exists()
    refused = ("unknown", "foreign", "worked", "unpacked/plugins/foreign", "../run", "")
    assert done.stdout.splitlines() == [
        *(f"{shape} loaded []" for shape in ("sphere", "disk", "cube")),
        *(f"{shape} refused True" for shape in refused),
        "worked refused",
        "plugins/worked refused",
    ], done.stderr


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 imports from the working directory: see trust.md")
def test_workers_run_nothing_from_the_working_directory(unpacked, library):
    """Neither libraries named as plugins, nor modules named as Python's."""
    taxel = Path(sys.executable).with_name("taxel")
    words = ["sweep", unpacked, "--vary", "shape=sphere,disk", "--points", "1", "-o", "study", "--workers", "1"]
    done = subprocess.run([taxel, *words], cwd=unpacked.parents[1], capture_output=True, text=True)
    assert not library[1].exists()
    assert done.returncode == 0, done.stderr


def test_a_folder_that_is_named_is_trusted(unpacked, library, monkeypatch, llvm_mono):
    """Mitsuba then refuses the library for what it is."""
    scene = Scene(unpacked, {"shape": "foreign"})
    with pytest.raises(InputError) as refused:
        scene.load()
    assert str(refused.value).endswith(f"set {libraries.VARIABLE}={unpacked.parent}.")
    monkeypatch.setenv(libraries.VARIABLE, str(unpacked.parent))
    with pytest.raises(InputError, match="Could not resolve the entry point of plugin"):
        scene.load()
    assert library[1].exists()
    library[1].unlink()


def test_no_search_path_of_a_scene_remains(unpacked, tmp_path, llvm_mono):
    before = [str(folder) for folder in llvm_mono.file_resolver()]
    scene = Scene(unpacked)
    scene.load()
    scene.write_xml(tmp_path / "written.xml")
    check_scene(unpacked)
    assert [str(folder) for folder in llvm_mono.file_resolver()] == before
