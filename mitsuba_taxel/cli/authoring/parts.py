"""`taxel parts`: photo-reflectors from datasheets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from ..options import debug_option, json_option

CLEARLY = 0.05
"""Least reduction of the difference from a datasheet's curve, relative to its peak, for which another reflector is
proposed."""


@click.command(short_help="Photo-reflectors from datasheets.")
@click.argument("name", metavar="[NAME|FILE.toml]", required=False)
@click.option(
    "-o", "--output", "file", type=click.Path(path_type=Path), metavar="PART.png", help="Draw the part, as PNG or SVG."
)
@click.option(
    "--edges", "height", type=float, metavar="MM",
    help="Also print the positions of a mirror's edge, at this height, for 10, 50 and 90 % of the largest current.",
)  # fmt: skip
@json_option
@debug_option
def command(name: str | None, file: Path | None, height: float | None, as_json: bool) -> None:
    """List the photo-reflectors of the catalogue, or show one of them, or one described by your own file.

    Prints its body, windows and dies; values of the datasheet, their source, and missing values; and the computed
    current under a mirror or white card beside that of the datasheet.
    """
    from mitsuba_taxel.parts import leaving_share, part_names, read_datasheet

    from ..tables import print_json, print_table

    if name is None:
        if file is not None:
            raise click.UsageError("-o is not allowed without a part: name one.")
        if height is not None:
            raise click.UsageError("--edges is not allowed without a part: name one.")
        parts = [read_datasheet(name) for name in part_names()]
        if as_json:
            print_json([{"name": part.name, "title": part.title, "source": part.source} for part in parts])
        else:
            print_table(("part", "what it is"), ((part.name, part.title) for part in parts))
        return
    sheet = read_datasheet(name)
    if sheet.missing and file is None and height is None:
        if as_json:
            from dataclasses import asdict

            print_json({**asdict(sheet), "missing": sheet.missing})
        else:
            _show_datasheet(sheet)
        return
    part = sheet.with_numbers({})
    edges = _edges(part, height)
    if file is not None:
        _draw(part, file)
    if as_json:
        from dataclasses import asdict

        print_json(
            {**asdict(part), "leaving_share": leaving_share(part), "model_curve": _curve(part), "edges_mm": edges}
        )
    else:
        _show(part)
        if height is not None:
            _show_edges(edges, height)


def _draw(part, file: Path) -> None:
    from mitsuba_taxel.base.files.atomic import replacing
    from mitsuba_taxel.plots.parts import plot_part
    from mitsuba_taxel.studies.plan.files import check_new_file

    check_new_file(file, ".png", ".svg")
    with replacing(file) as new:
        plot_part(part).savefig(new, format=file.suffix.lower().removeprefix("."))


def _curve(part) -> list[tuple[float, float, float]]:
    """Table rows of a distance curve: height in mm, current of the datasheet, and computed current, both relative to
    the largest."""
    import numpy as np

    from mitsuba_taxel.parts import distance_model

    if not part.distance_curve:
        return []
    heights, currents = np.array(part.distance_curve).T
    most = distance_model(part, np.linspace(heights.min(), heights.max(), 200)[:60]).max()
    model = distance_model(part, heights)
    return list(zip(heights.tolist(), currents.tolist(), (model / max(most, model.max())).tolist(), strict=True))


def _largest_difference(curve: list[tuple[float, float, float]]) -> float:
    return max(abs(given - model) for _, given, model in curve)


def _edges(part, height: float | None) -> dict[str, list[float]]:
    """Positions of a mirror's edge, along x and y, at which the current is 10, 50 and 90 %; none without a height."""
    from mitsuba_taxel.parts import edge_positions

    return {} if height is None else {word: edge_positions(part, height, k).tolist() for k, word in enumerate("xy")}


def _show_edges(edges: dict[str, list[float]], height: float) -> None:
    from ..tables import print_table, say

    rows = ((word, *(f"{position:.3f}" for position in positions)) for word, positions in edges.items())
    say(f"\nPosition of the edge of a mirror at {height:g} mm, from the middle of the body")
    print_table(("along", "10 % [mm]", "50 % [mm]", "90 % [mm]"), rows)


def _show_datasheet(sheet) -> None:
    """Print the datasheet values of a part whose geometry is unknown."""
    from ..tables import print_table, say

    say(f"{sheet.title}\nSource: {sheet.source}")
    say(f"Body {' x '.join(f'{side:g}' for side in sheet.body)} mm, {sheet.wavelength:g} nm")
    say(f"No reading can be computed, because the file states as unknown: {', '.join(sheet.missing)}.")
    _show_figures(sheet)
    if sheet.distance_curve:
        say(f"\nCurrent under a {sheet.distance_reflector}, relative to the largest")
        print_table(("height [mm]", "datasheet"), ((f"{z:g}", f"{current:.1%}") for z, current in sheet.distance_curve))


def _show_figures(part) -> None:
    from ..tables import print_table, print_text_table, say

    if part.electrical:
        say()
        print_table(("figure", "value"), ((name, f"{value:g}") for name, value in part.electrical.items()))
    if part.unknown:
        say(f"\nNot known: {', '.join(part.unknown)}.")
    if part.sources:
        say()
        print_text_table(("number", "its source; all other numbers are from the source above"), part.sources.items())


def _show(part) -> None:
    from mitsuba_taxel.parts import leaving_share
    from mitsuba_taxel.parts.part import REFLECTORS

    from ..tables import print_table, say

    say(f"{part.title}\nSource: {part.source}")
    say(
        f"Body {' x '.join(f'{side:g}' for side in part.body)} mm, {part.wavelength:g} nm, resin {part.resin_index:g}\n"
    )
    print_table(
        ("", "x [mm]", "y [mm]", "window [mm]", "die [mm]", "depth [mm]", "law"),
        (
            (
                name,
                f"{side.x:g}",
                f"{side.y:g}",
                f"{side.window_width:g} x {side.window_length:g} {side.window_shape} at "
                f"({side.window_centre[0]:g}, {side.window_centre[1]:g})",
                f"{side.die_width:g} x {side.die_length:g}",
                f"{side.die_depth:g}",
                side.law if side.exponent is None else f"{side.law}, {side.exponent:g}",
            )
            for name, side in (("emitter", part.emitter), ("detector", part.detector))
        ),
    )
    say(f"\nOf the light that the emitter sends into the resin, {leaving_share(part):.1%} leaves the window.")
    _show_figures(part)
    curve = _curve(part)
    if curve:
        say(f"\nCurrent under a {part.distance_reflector}, relative to the largest")
        print_table(
            ("height [mm]", "datasheet", "these dies"), ((f"{z:g}", f"{a:.1%}", f"{b:.1%}") for z, a, b in curve)
        )
        difference = _largest_difference(curve)
        say(f"Largest difference: {difference:.1%} of the peak")
        for other in REFLECTORS:
            under_other = _largest_difference(_curve(replace(part, distance_reflector=other)))
            if under_other < difference - CLEARLY:
                say(
                    f"With distance_reflector = {other!r}, for a curve under a {other}, the difference is "
                    f"{under_other:.1%}."
                )
