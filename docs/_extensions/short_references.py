"""Adapts the docstrings of this project to Sphinx.

In these docstrings a letter may follow a literal directly, and references contain only the last part of a name.
"""

from __future__ import annotations

import re

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.nodes import make_refnode

LITERAL = re.compile(r"(``[^`]+``)(\w?)")

_whole: dict[str, list[str]] = {}
"""Docstrings of properties; napoleon would take the text before a colon as a type."""


def with_closed_literals(line: str) -> str:
    """Change a line of a docstring such that no letter follows a literal directly."""
    return LITERAL.sub(lambda match: f"{match[1]}\\ {match[2]}" if match[2] else match[0], line)


def _before_napoleon(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = map(with_closed_literals, lines)
    if what in ("attribute", "property"):
        _whole[name] = list(lines)


def _after_napoleon(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = _whole.pop(name, lines)


def _resolve(app: Sphinx, env, node: nodes.Element, contnode: nodes.Element) -> nodes.Element | None:
    """Resolve a reference to the only entry with this last name; in a signature, the bare name if there is none."""
    if node.get("refdomain") != "py":
        return None
    last = node["reftarget"].split(".")[-1]
    objects = env.get_domain("py").objects
    found = [name for name in objects if name.split(".")[-1] == last and objects[name].objtype != "module"]
    if len(found) == 1:
        entry = objects[found[0]]
        return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, contnode, found[0])
    return contnode if _is_in_signature(node) else None


def _is_in_signature(node: nodes.Node) -> bool:
    return node is not None and (isinstance(node, addnodes.desc_signature) or _is_in_signature(node.parent))


def setup(app: Sphinx) -> dict[str, object]:
    app.connect("autodoc-process-docstring", _before_napoleon, priority=100)
    app.connect("autodoc-process-docstring", _after_napoleon, priority=900)
    app.connect("missing-reference", _resolve)
    return {"parallel_read_safe": True}
