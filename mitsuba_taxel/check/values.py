"""Values that Mitsuba's parser refuses, each tested alone since the parser stops at the first."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from xml.sax.saxutils import quoteattr

import mitsuba as mi

from mitsuba_taxel.check.document import Element, filled_in
from mitsuba_taxel.check.finding import Finding

_TAGS = ("integer", "float", "boolean", "string", "vector", "point")


def refused_values(root: Element, parameters: Mapping[str, str]) -> Iterator[Finding]:
    """Errors in the numbers, words and vectors of a file."""
    for element in root.walk():
        if element.tag not in _TAGS:
            continue
        attributes = {name: filled_in(value, parameters) for name, value in element.attributes.items()}
        if not any("$" in value for value in attributes.values()):
            refusal = _refusal(element.tag, attributes)
            if refusal:
                yield element.finding("error", f"{attributes.get('name', 'a value')}: {refusal}.")


def _refusal(tag: str, attributes: Mapping[str, str]) -> str:
    """Mitsuba's message for one value; empty if it accepts it."""
    words = " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items())
    scene = f'<scene version="{mi.__version__}"><shape type="rectangle"><{tag} {words}/></shape></scene>'
    try:
        mi.parser.parse_string(mi.parser.ParserConfig(mi.variant()), scene)
    except RuntimeError as error:
        text = " ".join(str(error).split())
        return re.sub(r"^\[[^\]]*\] (.*\(line \d+, col \d+\): )?", "", text).removesuffix(".")
    return ""
