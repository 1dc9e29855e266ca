"""A section of the page of measured sensors: what else was assumed of the pad, and what that changed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.reproduce import measured
from mitsuba_taxel.reproduce.pad_assumptions import PREDICTED, Tried, expected_at, ratio
from mitsuba_taxel.reproduce.pad_comparison import Compared, Results
from mitsuba_taxel.reproduce.page_pad import MAP_TARGET
from mitsuba_taxel.reproduce.page_words import paragraph


def assumptions_section(found: Results, tried: Mapping[str, Tried]) -> str:
    """The section of the page."""
    fitted = measured.PRESSED
    heads = [
        "assumed",
        f"force of {fitted} [%]",
        f"change of {fitted} [%]",
        f"change of {PREDICTED} by that of {fitted}",
        "map: beyond the target",
        "largest [points]",
    ]
    there, here = ratio(found)
    rows = [["as above", *_errors(found.taxels[fitted]), f"{here:.2f}", *_missed(found.moved)]]
    rows += [
        [words, *_errors(one.fitted), f"{one.ratio:.2f}" if np.isfinite(one.ratio) else "-", *_missed(one.held)]
        for words, one in tried.items()
    ]
    return f"""\
### What else may be so
Nothing is published of the following. One thing at a time, with the height and the indenter found above, and the
modulus and the begin of the record found anew; largest differences as above, and the changes at the largest force of
taxel {PREDICTED}, measured {there:.2f}:

{markdown_table(heads, rows)}

{paragraph(_verdict(found, tried, there))}
"""


def _errors(one: Compared) -> list[str]:
    return [f"{errors[np.nanargmax(np.abs(errors))]:+.1f}" for errors in (one.force_error, one.change_error)]


def _missed(held: np.ndarray) -> list[str]:
    off = held - np.array(measured.HELD_MAP)
    return [f"{(np.abs(off) > MAP_TARGET).sum()} of {off.size - 1}", f"{off.flat[np.abs(off).argmax()]:+.0f}"]


def _verdict(found: Results, tried: Mapping[str, Tried], there: float) -> str:
    """What explains the taxels that are missed, and what does not."""
    nearest = min(tried, key=lambda words: abs(np.nan_to_num(tried[words].ratio) - there))
    words = f"The nearest ratio is {tried[nearest].ratio:.2f}, of: {nearest}."
    measured_there, computed, expected = expected_at(found)
    if abs(expected - measured_there) >= abs(computed - measured_there):
        return words
    return (
        f"{words} What the model lacks is taxel {PREDICTED}'s own: pressed itself, that changes "
        f"{expected / computed:.2f} times as much as computed, and so it does in the map, while taxel "
        f"{measured.PRESSED} is pressed, where that would make {expected:.0f} of {computed:.0f}; measured, "
        f"{measured_there:.0f}."
    )
