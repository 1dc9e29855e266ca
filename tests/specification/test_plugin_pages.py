"""Every plugin has a page, read from its docstring without importing the plugin."""

from __future__ import annotations

import ast
import subprocess
import sys

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.backend import plugin_files
from mitsuba_taxel.specification.plugin_pages import plain, plugin_names, plugin_page

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("name", sorted(plugin_files()))
def test_page_is_complete(name):
    page = plugin_page(name)
    assert page.kind == plugin_files()[name].parent.name[:-1]
    assert page.title and page.title != name and page.text and f'type="{name}"' in page.example
    assert ast.literal_eval(f"{{{page.python_example}}}")["type"] == name
    assert page.parameters
    for row in page.parameters:
        texts = (row.label, row.type, plain(row.description), page.text)
        assert all(texts) and row.type.isalpha() and row.doc.endswith(".")
        assert not set("".join(texts)) & set("`|"), "markup is left"


@pytest.mark.parametrize(
    "name, unit, default",
    [
        ("annular_led.power", "W", "1"),
        ("annular_led.wavelength", "nm", "925"),
        ("annular_led.cone_angle", "degrees", "88"),
        ("wall.rms_slope", "degrees", ""),
        ("wall.reflectance_table", "", "none"),
        ("deformable_pad.force", "N", "0, 0, 0"),
        ("deformable_pad.youngs_modulus", "MPa", "4.16"),
        ("deformable_pad.shore_a", "Shore A", "none"),
        ("deformable_pad.cell_height", "mm", "1.55; spherical 1.6; hemispheric 0.5 + cell_size / 2"),
        ("deformable_pad.poisson_ratio", "", "0.49, or that of the silicone"),
        ("deformable_pad.rms_height", "mm", ""),
    ],
)
def test_unit_and_default(name, unit, default):
    plugin, _, parameter = name.partition(".")
    (row,) = (row for row in plugin_page(plugin).parameters if row.name == parameter)
    assert (row.unit, row.default_text) == (unit, default)


def test_what_a_row_says():
    rows = {row.name: plain(row.description) for row in plugin_page("annular_led").parameters}
    assert rows["cone_angle"] == (
        "Half-angle of the cone against the normal. From 0.05 to 90; for law uniform_solid_angle or "
        "uniform_polar_angle. (Default: 88)"
    )
    assert rows["shape"].endswith("One of square, circular. (Default: square)")


def test_no_plugin_is_imported():
    code = "import sys; from mitsuba_taxel.specification.plugin_pages import *; list(map(plugin_page, plugin_names()));"
    code += "print([name for name in sys.modules if name.startswith('mitsuba_taxel.plugins.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_unknown_plugin():
    with pytest.raises(InputError, match="wal.*annular_led"):
        plugin_page("wal")
    assert set(plugin_names()) == set(plugin_files())
