"""What each plugin may be told, as its parameter table has it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from mitsuba_taxel.backend.plugin_pages import plain, plugin_names, plugin_page

KINDS = (
    "integrator", "shape", "bsdf", "emitter", "sensor", "film", "rfilter", "sampler", "texture", "medium", "phase",
    "volume",
)  # fmt: skip
"""Elements of a Mitsuba scene that stand for an object of a plugin."""

ELEMENTS = {
    "float": ("float", "integer"),
    "int": ("integer",),
    "string": ("string",),
    "vector": ("vector", "point"),
    "transform": ("transform",),
}
"""XML elements that may give a parameter of each type."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a plugin.

    Attributes
    ----------
    name : as in a scene
    type : ``float``, ``int``, ``string``, ``vector`` or ``transform``
    values : the words that a string may be; empty where it may be any
    text : what its table says of it
    """

    name: str
    type: str
    values: tuple[str, ...]
    text: str


@dataclass(frozen=True)
class Vocabulary:
    """All that may stand in an element of a plugin.

    Attributes
    ----------
    name, kind, title : as ``wall``, ``bsdf``, ``Wall``
    parameters : numbers, words, vectors and transformations, by name
    nested : kinds of the objects that may be nested in it, with any name
    named : kind of each object that must be nested by its name, by that name
    """

    name: str
    kind: str
    title: str
    parameters: dict[str, Parameter]
    nested: frozenset[str]
    named: dict[str, str]


@cache
def vocabulary(plugin: str) -> Vocabulary:
    """What the plugin of a name may be told; raises `InputError` where there is none."""
    page = plugin_page(plugin, str)
    parameters: dict[str, Parameter] = {}
    nested, named = set(), {}
    for names, kind, text in page.parameters:
        for name in names.split(", "):
            if kind not in KINDS:
                parameters[name] = Parameter(name, kind, _listed(text) if kind == "string" else (), plain(text))
            elif name in ("(nested)", kind):
                nested.add(kind)
            else:
                named[name] = kind
    return Vocabulary(page.name, page.kind, page.title, parameters, frozenset(nested), named)


@cache
def vocabularies() -> dict[str, Vocabulary]:
    """Those of all plugins, by name."""
    return {name: vocabulary(name) for name in plugin_names()}


def _listed(text: str) -> tuple[str, ...]:
    """The words that a string may be: those marked in its description, if its default is one of them."""
    meaning, _, default = text.partition("(Default: ")
    words = tuple(dict.fromkeys(re.findall(r":monosp:`(\w+)`", meaning)))
    marked = re.match(r":monosp:`(\w+)`", default)
    return words if marked and marked[1] in words else ()
