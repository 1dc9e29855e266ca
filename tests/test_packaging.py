"""What `pip install` brings: every package of the tree, and the scenes."""

from __future__ import annotations

import ast
import re
import runpy
import subprocess
import sys
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from mitsuba_taxel.base.files import toml
from mitsuba_taxel.base.kinds import Kind

ROOT = Path(__file__).parents[1]
MACHINES = {
    "Linux x86-64": ("linux", "Linux", "x86_64"),
    "Linux aarch64": ("linux", "Linux", "aarch64"),
    "macOS arm64": ("darwin", "Darwin", "arm64"),
    "Windows x86-64": ("win32", "Windows", "AMD64"),
}
"""Names of a system, as Python has them."""


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


def test_links_of_the_tree_may_be_files(tmp_path, monkeypatch):
    """As git writes them on Windows: a text that names the other folder."""
    given: list[list[str]] = []
    monkeypatch.setattr("setuptools.setup", lambda **arguments: given.append(arguments["packages"]))
    for file in (file.relative_to(ROOT) for top in ("mitsuba_taxel", "plugins", "scenes") for file in packages_in(top)):
        (tmp_path / file.parent).mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch()
    (tmp_path / "README.md").touch()
    for name in ("plugins", "scenes"):
        (tmp_path / "mitsuba_taxel" / name).write_text(f"../{name}")
    for folder in (ROOT, tmp_path):
        monkeypatch.chdir(folder)
        runpy.run_path(str(ROOT / "setup.py"))
    assert sorted(given[0]) == sorted(given[1]) and "mitsuba_taxel.plugins.bsdfs" in given[0]


def packages_in(top: str) -> list[Path]:
    return [file for file in (ROOT / top).glob("**/__init__.py") if "mitsuba_taxel/plugins" not in file.as_posix()]


@pytest.mark.parametrize("machine", MACHINES)
def test_what_has_no_wheel_is_not_asked_for(machine):
    """As the page says of which packages there are wheels."""
    page = (ROOT / "docs" / "howto" / "install.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if line.startswith("| ")]
    head = next(row for row in rows if machine in row)
    stated = {row[0].split()[0]: row[head.index(machine)] == "wheel" for row in rows if len(row) == len(head)}
    names = dict(zip(("sys_platform", "platform_system", "platform_machine"), MACHINES[machine], strict=True))
    project = toml.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    required = map(Requirement, [*project["dependencies"], *project["optional-dependencies"]["contact"]])
    asked = {one.name for one in required if one.marker is None or one.marker.evaluate(names)}
    for package in ("netgen-mesher", "pytetwild", "ipctk"):
        assert (package in asked) is stated[package], package
    assert ("karellen-llvm-core" in asked) is stated["LLVM"]


def test_checkers_know_the_oldest_python_and_pages_name_both_ends():
    """mypy then refuses names of a newer standard library, and ruff newer syntax."""
    settings = toml.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    allowed = SpecifierSet(settings["project"]["requires-python"])
    minors = [f"3.{minor}" for minor in range(30) if f"3.{minor}.0" in allowed]
    named = [line.split(" :: ")[-1] for line in settings["project"]["classifiers"] if "Python :: 3." in line]
    assert minors == named and len(minors) > 1
    assert settings["tool"]["mypy"]["python_version"] == minors[0]
    assert settings["tool"]["ruff"]["target-version"] == f"py{minors[0].replace('.', '')}"
    for page in ("README.md", "docs/start.md", "docs/reference/compatibility.md"):
        assert f"{minors[0]} to {minors[-1]}" in (ROOT / page).read_text(encoding="utf-8"), page


def test_classes_are_such_as_the_oldest_python_allows():
    """Unseen by mypy: Python 3.10 refuses named tuples with a second base, and ABCMeta there refuses ``name=``."""
    assert type(Kind) is type
    for file in (file for top in ("mitsuba_taxel", "plugins", "scenes") for file in (ROOT / top).rglob("*.py")):
        if b"NamedTuple" not in (source := file.read_bytes()):
            continue
        classes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
        for bases in (list(map(ast.unparse, node.bases)) for node in classes):
            assert "NamedTuple" not in bases or len(bases) == 1, (file, bases)


def test_links_of_the_readme_lead_to_where_the_source_is_hosted(monkeypatch):
    arguments = {}
    monkeypatch.setattr("setuptools.setup", lambda **given: arguments.update(given))
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("PROJECT_URL", "https://example.org/me/taxel/")
    runpy.run_path("setup.py")
    text = arguments["long_description"]
    assert "](https://example.org/me/taxel/blob/HEAD/docs/start.md)" in text
    assert "](https://example.org/me/taxel/raw/HEAD/docs/pictures/pad_pressed.png)" in text
    assert all(link.startswith("https://") for link in re.findall(r"\]\(([^)]+)\)", text))
    assert set(arguments["project_urls"]) == {"Source", "Documentation", "Issues", "Changelog"}
    monkeypatch.delenv("PROJECT_URL")
    runpy.run_path("setup.py")
    assert arguments["long_description"] == (ROOT / "README.md").read_text(encoding="utf-8")
    assert arguments["project_urls"] == {}


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
