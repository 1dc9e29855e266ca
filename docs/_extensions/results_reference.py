"""The directive ``results-reference``: a table of all results of a reading, from their list."""

from __future__ import annotations

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles

from mitsuba_taxel.sensing.reading.results import RESULTS

HEADINGS = ("name", "unit", "for each", "in `readings.csv`", "meaning")


class ResultsReference(SphinxDirective):
    """One row for each result."""

    def run(self) -> list[nodes.Node]:
        rows = [HEADINGS]
        for result in RESULTS:
            of_parameter = "of the parameter" if "parameter" in result.per else "–"
            unit = {"": of_parameter, "1": "–"}.get(result.unit, result.unit)
            each = " and ".join(result.per) or "scene"
            rows.append((f"``{result.name}``", unit, each, "yes" if result.in_table else "no", result.meaning))
        table = [".. list-table::", "   :header-rows: 1", ""]
        for first, *rest in rows:
            table += [f"   * - {first}", *(f"     - {cell}" for cell in rest)]
        section = nodes.section()
        section.document = self.state.document
        nested_parse_with_titles(self.state, StringList(table, source="the list of results"), section)
        return section.children


def setup(app: Sphinx) -> dict[str, object]:
    app.add_directive("results-reference", ResultsReference)
    return {"parallel_read_safe": True}
