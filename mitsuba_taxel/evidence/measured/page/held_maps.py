"""A section of the page of measured sensors: maps of all taxels while other taxels than the middle one are held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.held_maps import HeldMapComparison, rms
from mitsuba_taxel.evidence.measured.taxel_spread import map_deviation
from mitsuba_taxel.evidence.paper.page.words import paragraph

RMS_TARGET = 3.0
"""Root mean square of the differences in points that was to be reached."""
CLEAR = 10.0
"""Computed change, in percent of that of the held taxel, from which ratios are averaged."""


def maps_section(maps: Sequence[HeldMapComparison], own: Mapping[int, float]) -> str:
    """Text of the section on held taxels.

    ``maps`` are the measured and computed maps of all taxels while one is held. ``own`` are the sensitivities of taxels
    that were pressed themselves, relative to the computed ones.
    """
    numbers = ", ".join(str(each.taxel) for each in maps)
    return f"""\
### All taxels while taxels {numbers} are held
{paragraph(_verdict(maps))}

The model is the one fitted to taxel {measured.PRESSED}. The place of the indenter is not published; it alone is fitted
to each map (two numbers for 24 taxels). The maps are computed by finite elements for these places, at the travel of the
hold. A number is the change of a taxel in percent of that of the held taxel: measured / computed, arranged as on the
board.

{"".join(_map(each) for each in maps)}
{markdown_table(["held taxel", "place", "rms", "largest difference"], _errors(maps))}

{paragraph(_scatter(maps, own))}

{paragraph(_causes([each for each in maps if each.taxel != measured.PRESSED]))}
"""


def _map(each: HeldMapComparison) -> str:
    record = measured.HELD_PRESSES[each.taxel]
    x, y = (f"{offset:+.2f} mm" for offset in each.place)
    heads = ["", *(f"column {number}" for number in range(1, bench_pad.SIDE + 1))]
    rows = [
        [f"row {number}", *(f"{a:.0f} / {b + 0.0:.0f}" for a, b in zip(*row, strict=True))]
        for number, row in enumerate(zip(each.measured, each.placed, strict=True), start=1)
    ]
    own = 100 * each.computed.changes[each.taxel - 1]
    words = (
        f"**Taxel {each.taxel}**, held at {record.travel:.2f} mm: force {record.force:.2f} N measured, "
        f"{each.computed.force:.2f} N computed; its own voltage changes by {100 * record.change:.1f} % measured, "
        f"{own:.1f} % computed. Fitted place of the indenter: {x} along x and {y} along y."
    )
    return f"{paragraph(words)}\n\n{markdown_table(heads, rows)}\n\n".replace("-0 ", "0 ")


def _errors(maps: Sequence[HeldMapComparison]) -> list[list[str]]:
    def row(taxel: int, place: str, difference: np.ndarray) -> list[str]:
        worst = np.unravel_index(int(np.abs(difference).argmax()), difference.shape)
        site = f"row {worst[0] + 1}, column {worst[1] + 1}"
        return [str(taxel), place, f"{rms(difference):.1f}", f"{difference[worst]:+.1f}, {site}"]

    rows = []
    for each in maps:
        rows.append(row(each.taxel, "middle", each.centred - each.measured))
        rows.append(row(each.taxel, "fitted", each.placed - each.measured))
    return rows


def _verdict(maps: Sequence[HeldMapComparison]) -> str:
    reached = {each.taxel: rms(each.placed - each.measured) for each in maps}
    shares = ", ".join(
        f"{100 * (1 - (reached[each.taxel] / rms(each.centred - each.measured)) ** 2):.0f} % (taxel {each.taxel})"
        for each in maps
    )
    within = [taxel for taxel, value in reached.items() if value <= RMS_TARGET]
    beyond = [f"taxel {taxel} has {value:.1f}" for taxel, value in reached.items() if value > RMS_TARGET]
    kept = f"the maps of taxels {', '.join(map(str, within))} are" if len(within) > 1 else (
        f"the map of taxel {within[0]} is" if within else "no map is"
    )  # fmt: skip
    return (
        f"With the fitted places, {kept} within the target of {RMS_TARGET:g} points{'; ' if beyond else ''}"
        f"{', '.join(beyond)}. The place of the indenter explains {shares} of the mean square difference: an indenter "
        "that is a few tenths of a millimetre beside the middle presses one neighbour more than the other."
    )


def _scatter(maps: Sequence[HeldMapComparison], own: Mapping[int, float]) -> str:
    """Sentences about the differences that the spread of the taxels' sensitivities explains."""
    expected = [rms(map_deviation(own, each.placed, each.taxel)) for each in maps]
    above = sum(value > RMS_TARGET for value in expected)
    verdict = (
        f"So a target of {RMS_TARGET:g} points asks for less than the taxels' own spread."
        if above == len(maps)
        else f"This is more than the target of {RMS_TARGET:g} points in {above} of {len(maps)} maps."
    )
    text = (
        f"**What the taxels' spread allows.** Pressed themselves, taxels {', '.join(map(str, own))} change "
        f"{', '.join(f'{value:.2f}' for value in own.values())} times as much as computed. If all taxels are spread "
        f"so, a model that is exact otherwise has an rms of {' / '.join(f'{value:.1f}' for value in expected)} points "
        f"in these maps. {verdict}"
    )
    middle = next((each for each in maps if each.taxel == measured.PRESSED), None)
    if middle is None:
        return text
    factors = np.ones(middle.placed.size)
    for taxel, value in own.items():
        factors[taxel - 1] = value / own[measured.PRESSED]
    corrected = rms(middle.placed * factors.reshape(middle.placed.shape) - middle.measured)
    return (
        f"{text} With the sensitivities of these taxels, which are not taken from its map, the map of taxel "
        f"{measured.PRESSED} has an rms of {corrected:.1f} points."
    )


def _causes(maps: Sequence[HeldMapComparison]) -> str:
    """Sentences about changes that are larger than computed around a whole press."""
    sentences = []
    for each in maps:
        ratios = each.ratio[each.placed >= CLEAR]
        share = each.computed.force / measured.HELD_PRESSES[each.taxel].force
        sentences.append(
            f"While {each.taxel} is held, the {len(ratios)} taxels with at least {CLEAR:g} points change "
            f"{np.median(ratios):.2f} times as much as computed in the median ({ratios.min():.2f} to "
            f"{ratios.max():.2f}), and the computed force differs by {100 * (share - 1):+.0f} %."
        )
    return (
        "**Relative to rest.** Maps relative to the held taxel do not show whether all taxels change more than "
        f"computed. {' '.join(sentences)} So the deviation is not that of a single taxel: the pad around a held taxel "
        "responds more, or less, than computed at the same force. Neither the gain of a part, which cancels relative "
        "to rest, nor the place of the indenter explains this. Of the assumptions in the next table, only collars that "
        "hold nothing raise the changes at the same force (by a fifth for taxel 13). It is not published how firmly "
        "the walls are held, and whether this differs from place to place. To decide, a map of the height of the pad "
        "and of its contact with the collars would be needed."
    )
