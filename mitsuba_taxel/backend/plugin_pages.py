"""The plugins' reference pages, read from their docstrings; no plugin is imported for it."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from mitsuba_taxel.backend import plugin_files
from mitsuba_taxel.base.errors import InputError

_UNIT = re.compile(r"\bin (mm|nm|N|MPa|W|degrees)\b|\bto [\d.]+ (degrees)\b|\bhardness (Shore A)\b")
_DEFAULT = re.compile(r"\s*\(Default: ((?:[^()]|\([^()]*\))*)\)$")


class Parameter(NamedTuple):
    """A row of a parameter table; one row may stand for several parameters of one kind."""

    name: str
    type: str
    description: str

    @property
    def unit(self) -> str:
        """Unit that the description names, empty for what has none."""
        found = _UNIT.search(self.description) if self.type in ("float", "vector") else None
        return next(filter(None, found.groups())) if found else ""

    @property
    def default(self) -> str:
        """What holds where a scene says nothing; empty if a scene must say it where it applies."""
        found = _DEFAULT.search(self.description)
        return found[1] if found else ""

    @property
    def meaning(self) -> str:
        """The description without the default."""
        return _DEFAULT.sub("", self.description)


@dataclass(frozen=True)
class PluginPage:
    """What a plugin's docstring says.

    Attributes
    ----------
    name, kind, title : as ``wall``, ``bsdf``, ``Wall``
    parameters : rows of the parameter table
    text : paragraphs after the table
    example, python_example : XML, and entries of a dictionary as for ``mi.load_dict``
    """

    name: str
    kind: str
    title: str
    parameters: tuple[Parameter, ...]
    text: str
    example: str
    python_example: str


def plugin_names() -> list[str]:
    """Names of all plugins, by kind and then alphabetically."""
    files = plugin_files()
    return sorted(files, key=lambda name: (files[name].parent.name, name))


def plain(text: str) -> str:
    """RST roles and substitutions as plain words on one line."""
    text = re.sub(r":\w+:`([^`]*)`", r"\1", text)
    text = re.sub(r"\|(\w+)\|", r"\1", text)
    return " ".join(text.replace("``", "").replace("`", "").split())


def plugin_page(name: str, convert: Callable[[str], str] = plain) -> PluginPage:
    """The page of one plugin.

    Parameters
    ----------
    name : of the plugin
    convert : makes of a docstring's RST what the page's texts are to be; the title is always plain

    Raises
    ------
    InputError
        if there is no plugin of that name.
    """
    files = plugin_files()
    if name not in files:
        raise InputError(f"{name!r} is no plugin: one of {', '.join(plugin_names())} is needed.")
    file = files[name]
    tree = ast.parse(file.read_text(encoding="utf-8"))
    docstrings = (ast.get_docstring(node) or "" for node in tree.body if isinstance(node, ast.ClassDef))
    docstring = next((text for text in docstrings if ".. pluginparameters::" in text), None)
    if docstring is None:
        raise ValueError(f"{file.name} holds no class whose docstring has a parameter table")
    head, _, rest = docstring.partition(".. pluginparameters::")
    table, text = _split_indented(rest)
    prose, _, tabs = text.partition(".. tabs::")
    title = re.search(r"^(.*)\n-+$", head, flags=re.MULTILINE)
    return PluginPage(
        name=name,
        kind=file.parent.name.removesuffix("s"),
        title=plain(title[1]).removesuffix(f"({name})").strip() if title else name,
        parameters=tuple(Parameter(plain(name), plain(kind), convert(text)) for name, kind, text in _rows(table)),
        text="\n\n".join(convert(paragraph) for paragraph in prose.strip().split("\n\n")),
        example=_tab(tabs, "xml"),
        python_example=_tab(tabs, "python"),
    )


def _split_indented(text: str) -> tuple[str, str]:
    """The indented block that ``text`` starts with, and what follows it."""
    end = re.search(r"^\S", text, flags=re.MULTILINE)
    return (text[: end.start()], text[end.start() :]) if end else (text, "")


def _rows(table: str) -> list[list[str]]:
    """Rows of an RST list-table: ``* -`` starts a row, ``-`` one of its three cells."""
    rows = [re.split(r"^ *- ", row, flags=re.MULTILINE) for row in re.split(r"^ *\* - ", table, flags=re.MULTILINE)[1:]]
    for row in rows:
        if len(row) != 3:
            raise ValueError(f"a row of a parameter table has {len(row)} cells, not 3: {plain(row[0])!r}")
    return rows


def _tab(tabs: str, language: str) -> str:
    """The code in the tab of a language, empty if there is none."""
    pattern = rf"\.\. code-tab:: {language}\n(.*?)(?:^ *\.\. code-tab::|\Z)"
    found = re.search(pattern, tabs, flags=re.MULTILINE | re.DOTALL)
    return textwrap.dedent(found[1]).strip() if found else ""
