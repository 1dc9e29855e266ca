"""What `pip install` brings: every package of the tree, and the scenes."""

from __future__ import annotations

import runpy
import subprocess
import sys
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_every_folder_with_python_is_installed(monkeypatch):
    arguments = {}
    monkeypatch.setattr("setuptools.setup", lambda **given: arguments.update(given))
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    folders = {
        file.parent for top in ("mitsuba_taxel", "plugins", "scenes") for file in (ROOT / top).rglob("__init__.py")
    }
    names = {name: folder for name, folder in arguments["package_dir"].items()}
    installed = set()
    for package in arguments["packages"]:
        root = max((name for name in names if f"{package}.".startswith(f"{name}.")), key=len)
        installed.add(ROOT / names[root] / package.removeprefix(root).lstrip(".").replace(".", "/"))
    assert len(installed) == len(arguments["packages"])
    assert installed == folders


def test_shipped_scenes_are_installed():
    from mitsuba_taxel import scenes

    installed = {file.name for folder in scenes.__path__ for file in Path(folder).glob("*.xml")}
    assert installed == {file.name for file in (ROOT / "scenes").glob("*.xml")} != set()


def test_names_that_rooms_load_lazily_are_found():
    """A file that has moved is missed at the first use only."""
    stubs = sorted((ROOT / "mitsuba_taxel").rglob("__init__.pyi"))
    rooms = [".".join(stub.parent.relative_to(ROOT).parts) for stub in stubs]
    assert "mitsuba_taxel.studies" in rooms
    for room in map(import_module, rooms):
        assert all(hasattr(room, name) for name in room.__all__), room


def test_version_is_that_of_the_distribution():
    import mitsuba_taxel

    assert "mitsuba_taxel" in packages_distributions()["mitsuba_taxel"]
    assert mitsuba_taxel.__version__ in (ROOT / "pyproject.toml").read_text()


def test_a_python_started_in_the_tree_finds_plugins_and_scenes():
    code = "import mitsuba_taxel, mitsuba_taxel.scenes as s; from mitsuba_taxel.backend import plugin_files;"
    code += "print(len(plugin_files()), *s.__path__)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    count, folder = done.stdout.split()
    assert int(count) >= 8 and (Path(folder) / "pad.xml").is_file()
