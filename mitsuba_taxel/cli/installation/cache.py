"""`taxel cache`: the folder of solved deformations."""

from __future__ import annotations

import click

from ..options import debug_option, json_option


@click.command(short_help="Solved deformations on disk.")
@click.option("--clear", is_flag=True, help="Remove all solutions, except those that a program is computing.")
@json_option
@debug_option
def command(clear: bool, as_json: bool) -> None:
    """Print the folder of solved deformations, and its size.

    The folder is MITSUBA_TAXEL_CACHE, or mitsuba_taxel in the user's cache folder. Beyond 10 GB the least recently used
    solutions are removed, but none that was used in the last ten minutes.
    """
    from mitsuba_taxel.mechanics import cache

    from ..tables import print_json

    removed = cache.remove_least_recently_used(0, spared=0.0) if clear else (0, 0)
    kept = [file.stat().st_size for file in cache.entries()]
    if as_json:
        about = {"folder": str(cache.folder()), "entries": len(kept), "bytes": sum(kept), "limit": cache.LARGEST}
        print_json(about | {"removed": removed[0], "removed_bytes": removed[1]})
        return
    if clear:
        click.echo(f"removed: {removed[0]} entries, {removed[1] / 1e6:.1f} MB")
    click.echo(f"folder: {cache.folder()}")
    click.echo(f"kept: {len(kept)} entries, {sum(kept) / 1e6:.1f} MB of at most {cache.LARGEST / 1e6:.0f} MB")
