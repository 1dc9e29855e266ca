"""`taxel check`: problems of a scene, before light is traced."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import click

from ..options import debug_option, defines_option, json_option


@click.command(short_help="Check a scene without rendering it; write the schema for editors.")
@click.argument("scene", required=False)
@defines_option
@click.option(
    "--schema", type=click.Path(path_type=Path), metavar="FILE.rng", help="Write the schema of scenes, for editors."
)
@json_option
@debug_option
@click.pass_context
def command(ctx: click.Context, scene: str | None, defines: dict[str, str], schema: Path | None, as_json: bool) -> None:
    """List errors and likely mistakes of SCENE, with their lines.

    If the scene has no errors, its pads are deformed, and the solutions are cached for `taxel render`, which then
    accepts the scene. The exit code is that of `taxel render`: 2 for errors of the scene, 1 if a computation stops, for
    example under a load that a pad cannot bear, and 0 if there are only warnings and notes.

    Editors with RELAX NG support complete and validate a scene with this first line, and the schema beside it:

    \b
    <?xml-model href="taxel.rng" schematypens="http://relaxng.org/ns/structure/1.0"?>
    """
    if scene is None and schema is None:
        raise click.UsageError("SCENE or --schema is needed.")
    if schema is not None:
        from mitsuba_taxel.check.schema import write_schema

        write_schema(schema)
        click.echo(f"Written: {schema}", err=as_json)
    if scene is not None:
        from mitsuba_taxel.check import check_scene
        from mitsuba_taxel.check.finding import SEVERITIES

        from ..tables import print_json, progress_bar, say

        with progress_bar("pads"):
            findings = check_scene(scene, **defines)
        if as_json:
            from dataclasses import asdict

            print_json({"findings": [asdict(finding) for finding in findings]})
        else:
            counts = Counter(finding.severity for finding in findings)
            say(", ".join(f"{severity}s: {counts[severity]}" for severity in SEVERITIES))
            for finding in findings:
                say(str(finding))
        ctx.exit(max((1 if f.stopped else 2 for f in findings if f.severity == "error"), default=0))
