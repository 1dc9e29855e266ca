"""The directive ``plugin-reference``: a section for every plugin, from its docstring."""

from __future__ import annotations

import re
import textwrap

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles

from mitsuba_taxel.specification.plugin_pages import PluginPage, plugin_names, plugin_page

KINDS = {
    "shape": "Shapes",
    "emitter": "Emitters",
    "sensor": "Sensors",
    "bsdf": "Walls",
    "integrator": "Integrators",
    "sampler": "Samplers",
}
SHOWN = {
    "deformable_pad": "A pad of nine spherical cells under a normal and a tangential force, cut open",
    "photo_reflector": "Six photo-reflectors, each with its LED (red) and phototransistor (green)",
    "annular_led": "Radiant intensity of three laws by angle, and the emitting areas of both outlines",
    "phototransistor": "Reading of a parallel beam by its angle to the normal, relative to that on the axis",
    "wall": "Light that four walls reflect in the plane of incidence, by angle; a mirror reflects it in one direction",
    "region": "Regions of a pad: roof (orange), side (yellow), top (blue) and outside (light blue); the cut is grey",
    "taxel_tracer": "Irradiance of one phototransistor under a Lambertian dome, by paths joined from both ends",
    "taxel_path": "The same irradiance, by as many paths from the phototransistor",
    "analog_tracer": "The same irradiance, by as many rays that are counted",
    "owen_sobol": "256 points of two sequences fill the square evenly; random numbers do not",
}
"""What the picture of each plugin shows; `python docs/draw_pictures.py` draws them."""
HEADINGS = ("parameter", "type", "unit", "default", "meaning")
WIDTHS = "20 9 9 17 45"


class PluginReference(SphinxDirective):
    """Sections of all plugins, sorted by kind; an unknown kind comes last."""

    def run(self) -> list[nodes.Node]:
        pages = [plugin_page(name, convert=_rst) for name in plugin_names()]
        kinds = [*KINDS, *sorted({page.kind for page in pages} - set(KINDS))]
        lines = []
        for kind in kinds:
            heading = KINDS.get(kind, kind)
            lines += [heading, "=" * len(heading), ""]
            for page in pages:
                if page.kind == kind:
                    lines += _section(page)
        section = nodes.section()
        section.document = self.state.document
        nested_parse_with_titles(self.state, StringList(lines, source="docstrings of the plugins"), section)
        return section.children


def _section(page: PluginPage) -> list[str]:
    """RST of the section of one plugin: picture, parameters, text, examples."""
    title = f"{page.title}: ``{page.name}``"
    rows = [HEADINGS]
    for row in page.parameters:
        name = row.label if row.label.startswith("(") else f"``{row.label}``"
        rows.append((name, row.type, row.unit or "–", row.default_text or "–", _rst(row.meaning)))
    parts = [
        f".. _plugin-{page.name}:",
        f"{title}\n{'-' * len(title)}",
        f".. image:: ../pictures/plugins/{page.name}.png\n   :alt: {SHOWN[page.name]}\n\n*{SHOWN[page.name]}.*",
        f".. list-table::\n   :header-rows: 1\n   :widths: {WIDTHS}",
        "\n".join(map(_row, rows)),
        page.text,
        "XML:",
        ".. code-block:: xml",
        textwrap.indent(page.example, "   "),
        "Python, for ``mi.load_dict``:",
        ".. code-block:: python",
        textwrap.indent(f"{{{page.python_example}}}", "   "),
    ]
    return "\n\n".join([*parts, ""]).splitlines()


def _row(cells: tuple[str, ...]) -> str:
    first, *rest = cells
    return "\n".join([f"   * - {first}", *(f"     - {cell}" for cell in rest)])


def _rst(text: str) -> str:
    """The RST of a docstring on one line, with roles as literals and names of plugins as links."""

    def literal(match: re.Match) -> str:
        word = match[1] or match[2] or match[3]
        return f":ref:`{word} <plugin-{word}>`" if word in plugin_names() else f"``{word}``"

    text = re.sub(r"\|(\w+)\|", r"\1", " ".join(text.split()))
    return re.sub(r":monosp:`([^`]*)`|``([^`]*)``|`([^`]*)`", literal, text)


def setup(app: Sphinx) -> dict[str, object]:
    app.add_directive("plugin-reference", PluginReference)
    return {"parallel_read_safe": True}
