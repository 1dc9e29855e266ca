"""Reference pages of plugins from their parameters and docstrings, without importing the plugins."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass

from mitsuba_taxel.backend import plugin_files, plugin_kind
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters import Parameter
from mitsuba_taxel.specification import specification_of


@dataclass(frozen=True)
class PluginPage:
    """Contents of the reference page of a plugin.

    Attributes
    ----------
    name, kind, title : str
        Name, kind and title, such as ``wall``, ``bsdf``, ``Wall``.
    parameters : tuple[Parameter, ...]
        Rows of the parameter table, with RST markup.
    text : str
        Paragraphs of the description.
    example, python_example : str
        Example in XML, and as entries of a dictionary for ``mi.load_dict``.
    """

    name: str
    kind: str
    title: str
    parameters: tuple[Parameter, ...]
    text: str
    example: str
    python_example: str


def plugin_names() -> list[str]:
    """Names of all plugins, by kind and then alphabetically.

    Returns
    -------
    list[str]
        Names, as in ``type="..."`` of a scene.
    """
    files = plugin_files()
    return sorted(files, key=lambda name: (files[name].parent.name, name))


def plain(text: str) -> str:
    """Convert RST markup to plain text on a single line.

    Parameters
    ----------
    text : str
        Text of a docstring.

    Returns
    -------
    str
        A single line.
    """
    text = re.sub(r":\w+:`([^`]*)`", r"\1", text)
    text = re.sub(r"\|(\w+)\|", r"\1", text)
    return " ".join(text.replace("``", "").replace("`", "").split())


def plugin_page(name: str, convert: Callable[[str], str] = plain) -> PluginPage:
    """Assemble the reference page of a plugin from its parameters and its docstring.

    Parameters
    ----------
    name : str
        Name of the plugin.
    convert : Callable[[str], str]
        Converts a docstring's RST to the format of the page; the title is always plain.

    Returns
    -------
    PluginPage
        Title, parameters, prose and examples.

    Raises
    ------
    InputError
        if there is no such plugin.
    ValueError
        if the file of the plugin has no such page.
    """
    files = plugin_files()
    if name not in files:
        raise InputError(f"{name!r} is not a plugin: one of {', '.join(plugin_names())} is needed.")

    # The docstring with the title of the plugin, found without importing the file.
    file = files[name]
    tree = ast.parse(file.read_text(encoding="utf-8"))
    docstrings = (ast.get_docstring(node) or "" for node in tree.body if isinstance(node, ast.ClassDef))
    docstring = next((text for text in docstrings if f"(:monosp:`{name}`)\n-" in text), None)
    if docstring is None:
        raise ValueError(f"{file.name} has no class whose docstring has a title with its name")

    # Title, prose and tabs.
    head, underline, rest = re.split(r"\n(-+)\n", docstring, maxsplit=1)
    prose, _, tabs = rest.partition(".. tabs::")
    return PluginPage(
        name=name,
        kind=plugin_kind(name),
        title=plain(head.splitlines()[-1]).removesuffix(f"({name})").strip(),
        parameters=specification_of(name).table(),
        text="\n\n".join(convert(paragraph) for paragraph in prose.strip().split("\n\n")),
        example=_tab(tabs, "xml"),
        python_example=_tab(tabs, "python"),
    )


def _tab(tabs: str, language: str) -> str:
    """Code example in the tab of a language; empty if there is no such tab."""
    pattern = rf"\.\. code-tab:: {language}\n(.*?)(?:^ *\.\. code-tab::|\Z)"
    match = re.search(pattern, tabs, flags=re.MULTILINE | re.DOTALL)
    return textwrap.dedent(match[1]).strip() if match else ""
