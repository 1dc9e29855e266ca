"""Names that users rely on: Python's, of the command line, and of the plugins. Run as a program, it prints the list."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import click

API_PAGE = Path(__file__).parents[2] / "docs" / "reference" / "api.rst"


def resolved(name: str) -> Any:
    """The object of a dotted name; of a function and a module of the same name the function."""
    words = name.split(".")
    for count in range(len(words), 0, -1):
        try:
            value: Any = import_module(".".join(words[:count]))
        except ModuleNotFoundError:
            continue
        for word in words[count:]:
            value = getattr(value, word)
        return getattr(value, words[-1], value) if inspect.ismodule(value) else value
    raise AssertionError(name)


def directives() -> Iterator[tuple[str, str, Any, str]]:
    """Kind, dotted name, object and options of each entry of the page of the Python API."""
    for kind, name, options in re.findall(
        r"^\.\. auto(\w+):: (\S+)\n((?:   :.*\n)*)", API_PAGE.read_text(), re.MULTILINE
    ):
        dotted = name if name.startswith("mitsuba_taxel.") else f"mitsuba_taxel.{name}"
        yield kind, dotted, resolved(dotted), options


def _parameters(function: Any) -> str:
    """Names of parameters in their order; those after * are passed by name."""
    words = []
    for parameter in inspect.signature(function).parameters.values():
        stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        words.append(stars + parameter.name)
    return ", ".join(word for word in words if word not in ("self", "cls"))


def python_names() -> Iterator[str]:
    """A line for each function, class and public method of the reference."""
    for kind, name, value, options in directives():
        if kind not in ("function", "class", "exception"):
            yield name
            continue
        yield f"{name}({_parameters(value)})"
        if kind == "class" and ":members:" in options:
            for word, member in sorted(vars(value).items()):
                function = getattr(member, "__func__", member)
                if word[0] != "_" and inspect.isfunction(function):
                    yield f"{name}.{word}({_parameters(function)})"


def command_names() -> Iterator[str]:
    """A line for each argument and option of each command of the program."""
    from taxel_cli import taxel

    def lines(command: click.Command, path: str) -> Iterator[str]:
        context = click.Context(command, info_name=path)
        for parameter in command.params:
            is_option = isinstance(parameter, click.Option)
            word = max(parameter.opts, key=len) if is_option else parameter.make_metavar(context)
            yield f"{path} {word}"
        if not command.params:
            yield path
        if isinstance(command, click.Group):
            for name in command.list_commands(context):
                below = command.get_command(context, name)
                assert below is not None
                yield from lines(below, f"{path} {name}")

    yield from lines(taxel, "taxel")


def plugin_lines() -> Iterator[str]:
    """A line for each parameter of each plugin."""
    from mitsuba_taxel.specification.plugin_pages import plugin_names, plugin_page

    for name in sorted(plugin_names()):
        page = plugin_page(name)
        yield from dict.fromkeys(f'<{page.kind} type="{name}"> {row.label}' for row in page.parameters)


def all_names() -> list[str]:
    """Sorted lines of the whole list."""
    return [*sorted(python_names()), *command_names(), *plugin_lines()]


if __name__ == "__main__":
    print("\n".join(all_names()))
