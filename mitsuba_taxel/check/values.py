"""Values that Mitsuba's parser refuses. Each value is parsed separately, because the parser stops at the first error.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from xml.sax.saxutils import quoteattr

import mitsuba as mi

from mitsuba_taxel.check.document import Element, filled_in
from mitsuba_taxel.check.finding import Finding

_TAGS = ("integer", "float", "boolean", "string", "vector", "point")


def refused_values(root: Element, parameters: Mapping[str, str]) -> Iterator[Finding]:
    """Find errors in the numbers, words and vectors of a file.

    Parameters
    ----------
    root : Element
        Root of the file.
    parameters : Mapping[str, str]
        Values of the ``$name`` references, by name.
    """
    for element in root.walk():
        if element.tag not in _TAGS:
            continue
        attributes = {name: filled_in(value, parameters) for name, value in element.attributes.items()}
        if not any("$" in value for value in attributes.values()):
            refusal = _refusal(element.tag, attributes)
            if refusal:
                yield element.finding("error", f"{attributes.get('name', 'a value')}: {refusal}.")


def _refusal(tag: str, attributes: Mapping[str, str]) -> str:
    """Mitsuba's error message for one value; empty if the value is accepted."""
    attribute_text = " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items())
    scene = f'<scene version="{mi.__version__}"><shape type="rectangle"><{tag} {attribute_text}/></shape></scene>'
    try:
        mi.parser.parse_string(mi.parser.ParserConfig(mi.variant()), scene)
    except RuntimeError as error:
        text = " ".join(str(error).split())
        return re.sub(r"^\[[^\]]*\] (.*\(line \d+, col \d+\): )?", "", text).removesuffix(".")
    return ""
