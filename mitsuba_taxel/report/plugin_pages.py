"""The plugins' reference pages, read from their docstrings; no plugin is imported for it."""

from __future__ import annotations

import ast
import re
import textwrap
from dataclasses import dataclass

from mitsuba_taxel.backend import plugin_files
from mitsuba_taxel.errors import InputError


@dataclass(frozen=True)
class PluginPage:
    """What a plugin's docstring says.

    Attributes
    ----------
    name, kind, title : as ``wall``, ``bsdf``, ``Wall``
    parameters : (name, type, description) of each row of the parameter table
    text : paragraphs after the table
    example : XML
    """

    name: str
    kind: str
    title: str
    parameters: tuple[tuple[str, str, str], ...]
    text: str
    example: str


def plugin_names() -> list[str]:
    """Names of all plugins, by kind and then alphabetically."""
    files = plugin_files()
    return sorted(files, key=lambda name: (files[name].parent.name, name))


def plugin_page(name: str) -> PluginPage:
    """The page of one plugin.

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
        title=_plain(title[1]).removesuffix(f"({name})").strip() if title else name,
        parameters=_rows(table),
        text="\n\n".join(_plain(paragraph) for paragraph in prose.strip().split("\n\n")),
        example=_xml(tabs),
    )


def _split_indented(text: str) -> tuple[str, str]:
    """The indented block that ``text`` starts with, and what follows it."""
    end = re.search(r"^\S", text, flags=re.MULTILINE)
    return (text[: end.start()], text[end.start() :]) if end else (text, "")


def _rows(table: str) -> tuple[tuple[str, str, str], ...]:
    """Rows of an RST list-table: ``* -`` starts a row, ``-`` one of its three cells."""
    rows = []
    for row in re.split(r"^ *\* - ", table, flags=re.MULTILINE)[1:]:
        cells = [_plain(cell) for cell in re.split(r"^ *- ", row, flags=re.MULTILINE)]
        if len(cells) != 3:
            raise ValueError(f"a row of a parameter table has {len(cells)} cells, not 3: {cells[0]!r}")
        rows.append((cells[0], cells[1], cells[2]))
    return tuple(rows)


def _xml(tabs: str) -> str:
    found = re.search(r"\.\. code-tab:: xml\n(.*?)(?:^ *\.\. code-tab::|\Z)", tabs, flags=re.MULTILINE | re.DOTALL)
    return textwrap.dedent(found[1]).strip() if found else ""


def _plain(text: str) -> str:
    """RST roles and substitutions as plain words on one line."""
    text = re.sub(r":\w+:`([^`]*)`", r"\1", text)
    text = re.sub(r"\|(\w+)\|", r"\1", text)
    return " ".join(text.replace("``", "").replace("`", "").split())
