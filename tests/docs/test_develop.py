"""Pages for developers: functions that are named exist, and recipes run."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

from forked_script import run_script

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "develop"
MOST = 8
"""Fields of a record that may be built by position."""


def test_what_the_way_of_a_reading_names_exists():
    names = re.findall(r"`(mitsuba_taxel(?:\.\w+)+)`", (PAGES / "reading.md").read_text())
    assert len(names) > 12
    for name in names:
        parts = name.replace("mitsuba_taxel.cli", "taxel_cli").split(".")
        for count in range(len(parts), 0, -1):
            try:
                found = import_module(".".join(parts[:count]))
            except ModuleNotFoundError:
                continue
            for attribute in parts[count:]:
                found = getattr(found, attribute)
            break
        else:
            raise AssertionError(name)


def test_every_room_states_its_input_its_output_and_its_contents():
    """As the map of rooms says; the folders of plugins and of scenes have no input, and the program has its help."""
    rooms = [file for file in (ROOT / "mitsuba_taxel").glob("*/__init__.py") if not file.parent.is_symlink()]
    texts = {file.parent.name: ast.get_docstring(ast.parse(file.read_text())) or "" for file in rooms}
    assert len(texts) > 20
    silent = [room for room, text in texts.items() if not re.search(r"Inputs?\b.*[Oo]utputs?\b", text, re.DOTALL)]
    assert silent == ["cli"]


def test_recipes_run(tmp_path):
    """In one process, each with names of its own."""
    blocks = re.findall(r"```python\n(.*?)```", (PAGES / "recipes.md").read_text(), re.DOTALL)
    assert len(blocks) >= 3
    for number, block in enumerate(blocks):
        (tmp_path / f"recipe_{number}.py").write_text(block)
    (tmp_path / "all.py").write_text("import runpy, sys\nfor file in sys.argv[1:]:\n    runpy.run_path(file)\n")
    solutions = str(tmp_path / "solutions")
    done = run_script(
        tmp_path / "all.py", tmp_path, *sorted(tmp_path.glob("recipe_*.py")), MITSUBA_TAXEL_CACHE=solutions
    )
    assert done.returncode == 0, done.stdout
    assert "power [W]" in done.stdout


def fields_of(node):
    return [part for part in node.body if isinstance(part, ast.AnnAssign) and "ClassVar" not in ast.dump(part)]


def test_large_records_are_built_by_the_names_of_their_fields():
    """In the files that name one: classes of fields alone, and calls of their names."""
    files = [file for room in ("mitsuba_taxel", "plugins") for file in (ROOT / room).rglob("*.py")]
    texts = {file: text for file in files if "@dataclass" in (text := file.read_text()) or "NamedTuple)" in text}
    classes = [node for text in texts.values() for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]
    large = {node.name for node in classes if len(fields_of(node)) > MOST}
    assert len(large) > 30 and "State" in large
    any_large = re.compile(rf"\b({'|'.join(large)})\(")
    calls = [
        (str(file.relative_to(ROOT)), node)
        for file in files
        if any_large.search(text := file.read_text())
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in large
    ]
    assert len(calls) > 60
    assert [(file, call.lineno, call.func.id) for file, call in calls if len(call.args) > 4] == []
