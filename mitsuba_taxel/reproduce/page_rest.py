"""A section of the page of measured sensors: spread of the voltages at rest."""

from __future__ import annotations

from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.reproduce import measured
from mitsuba_taxel.reproduce.page_words import paragraph
from mitsuba_taxel.reproduce.rest_spread import SAMPLES, SOURCES, Spread


def rest_section(found: Spread) -> str:
    """The section of the page."""
    rows = [[name, found.laws[name], SOURCES[name], f"{100 * found.shares[name]:.1f}"] for name in SOURCES]
    return f"""\
## Spread of the voltages at rest
One cell of the pad, its parameters drawn {SAMPLES} times from the distributions below and each sample computed
(`taxel tolerance` with a study that is written to DIR/tolerance). What is called assumed has no source: neither the
tolerances of that board, grid and mould are published, nor limits of the current of the NJL5908AR, in whose place those
of another part stand.

{markdown_table(["parameter", "distribution", "what, and source", "share of the variance [%]"], rows)}

{paragraph(_words(found))}
"""


def _words(found: Spread) -> str:
    low, high = found.without_gain, found.all
    inside = "lies between the two" if low <= measured.REST_SPREAD <= high else "**does not lie between the two**"
    least, most = measured.REST_VOLTAGES
    return (
        f"Standard deviation of the reading at rest, in percent of its mean: **{high:.0f} % with all of these**, "
        f"{low:.0f} % without the gain of the parts; measured, {measured.REST_SPREAD:g} % among 25 taxels (from "
        f"{least:g} to {most:g} V). The measured spread {inside}: with the other tolerances as assumed, a gain "
        f"that varies by {found.gain_for(measured.REST_SPREAD):.0f} % would explain it. That is a plausible "
        "figure for parts of one delivery, whose range is narrower than that of a datasheet, and no test: one "
        "number is met by many sets of tolerances."
    )
