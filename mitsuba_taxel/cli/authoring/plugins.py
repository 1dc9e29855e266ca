"""`taxel plugins`: parameters of each plugin."""

from __future__ import annotations

import textwrap

import click

from ..options import debug_option


@click.command(short_help="Parameters of each plugin.")
@click.argument("name", required=False)
@debug_option
def command(name: str | None) -> None:
    """List the plugins, or the parameters of plugin NAME: type, unit, meaning, default."""
    from mitsuba_taxel.specification.plugin_pages import plain, plugin_names, plugin_page

    from ..tables import print_text_table, text_width

    if name is None:
        pages = map(plugin_page, plugin_names())
        print_text_table(("plugin", "kind", "what it is"), [(p.name, p.kind, p.title) for p in pages])
        return
    page = plugin_page(name)
    click.echo(f"{page.name} ({page.kind}): {page.title}\n")
    rows = [(row.label, row.type, row.unit, plain(row.description)) for row in page.parameters]
    print_text_table(("parameter", "type", "unit", "meaning"), rows, text_width())
    for paragraph in page.text.split("\n\n"):
        click.echo("\n" + "\n".join(textwrap.wrap(paragraph, text_width())))
    for example in (page.example, f"{{{page.python_example}}}"):
        click.echo(f"\n{example}")
