"""Pages for developers: functions that are named exist, and recipes run."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

from forked_script import run_script

PAGES = Path(__file__).parents[2] / "docs" / "develop"


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
