"""Every plugin has a page, read from its docstring without importing the plugin."""

from __future__ import annotations

import subprocess
import sys

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.backend import plugin_files
from mitsuba_taxel.report.plugin_pages import plugin_names, plugin_page


@pytest.mark.parametrize("name", sorted(plugin_files()))
def test_page_is_complete(name):
    page = plugin_page(name)
    assert page.kind == plugin_files()[name].parent.name[:-1]
    assert page.title and page.title != name and page.text and f'type="{name}"' in page.example
    assert page.parameters
    for parameter, kind, meaning in page.parameters:
        assert parameter and kind.isalpha() and len(meaning) > 10
        assert not set(f"{parameter}{kind}{meaning}{page.text}") & set("`|"), "markup is left"


def test_rows_of_a_table():
    page = plugin_page("wall")
    assert [row[:2] for row in page.parameters] == [
        ("scattering", "string"),
        ("reflectance", "float"),
        ("reflectance_table", "string"),
        ("specular, lambertian, isotropic", "float"),
        ("rms_slope", "float"),
    ]
    assert page.parameters[1][2].endswith("(Default: 1)")


def test_no_plugin_is_imported():
    code = "import sys; from mitsuba_taxel.report.plugin_pages import *; list(map(plugin_page, plugin_names()));"
    code += "print([name for name in sys.modules if name.startswith('mitsuba_taxel.plugins.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_unknown_plugin():
    with pytest.raises(InputError, match="wal.*annular_led"):
        plugin_page("wal")
    assert set(plugin_names()) == set(plugin_files())
