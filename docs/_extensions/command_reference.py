"""The directive ``command-reference``: a section for every command of `taxel`, made from the program's help."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator

import click
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles


class CommandReference(SphinxDirective):
    """Sections of the program and of all its commands, in the order of ``taxel --help``."""

    def run(self) -> list[nodes.Node]:
        from taxel_cli import taxel

        lines = _overview(taxel)
        lines += [line for path, ctx in _commands(taxel, "taxel", None) for line in _section(path, ctx)]
        section = nodes.section()
        section.document = self.state.document
        nested_parse_with_titles(self.state, StringList(lines, source="taxel --help"), section)
        return section.children


def _overview(taxel: click.Group) -> list[str]:
    """RST of a table of all commands and subcommands, each with its short description."""
    rows = []
    for path, ctx in _commands(taxel, "taxel", None):
        if path != "taxel":
            label = path.replace(" ", "-")
            rows.append(f"   * - :ref:`{path} <{label}>`\n     - {_escaped(ctx.command.get_short_help_str(200))}")
    table = ".. list-table::\n   :header-rows: 1\n   :widths: 30 70\n\n   * - command\n     - what it does\n"
    return [*(table + "\n".join(rows)).splitlines(), ""]


def _commands(command: click.Command, path: str, parent: click.Context | None) -> Iterator[tuple[str, click.Context]]:
    """Path and context of a command and of all its subcommands."""
    ctx = click.Context(command, info_name=path.split()[-1], parent=parent, **command.context_settings)
    yield path, ctx
    if isinstance(command, click.Group):
        for name in command.list_commands(ctx):
            below = command.get_command(ctx, name)
            assert below is not None
            yield from _commands(below, f"{path} {name}", ctx)


def _section(path: str, ctx: click.Context) -> list[str]:
    """RST of the section of one command: description, usage, options."""
    title = f"``{path}``"
    usage = " ".join([path, *ctx.command.collect_usage_pieces(ctx)])
    parts = [f".. _{path.replace(' ', '-')}:", f"{title}\n{'=' * len(title)}", _escaped(ctx.command.help or "")]
    parts.append(f".. code-block:: text\n\n   {usage}")
    options = [param for param in ctx.command.get_params(ctx) if isinstance(param, click.Option)]
    records = [record for record in (option.get_help_record(ctx) for option in options) if record]
    rows = [f"   * - ``{option}``\n     - {_escaped(meaning)}" for option, meaning in records]
    parts.append(".. list-table::\n   :widths: 38 62\n\n" + "\n".join(rows))
    return "\n\n".join([*parts, ""]).splitlines()


def _escaped(text: str) -> str:
    """A help text with the markup characters of RST escaped, paragraph by paragraph."""
    return "\n\n".join(map(_paragraph, text.split("\n\n")))


def _paragraph(text: str) -> str:
    if text.startswith("\b"):  # what click must not wrap
        return ".. code-block:: text\n\n" + textwrap.indent(text.removeprefix("\b\n"), "   ")
    return re.sub(r"([*_`|\\])", r"\\\1", " ".join(text.split()))


def setup(app: Sphinx) -> dict[str, object]:
    app.add_directive("command-reference", CommandReference)
    return {"parallel_read_safe": True}
