"""Section of the page of measured sensors: spread of the voltages at rest."""

from __future__ import annotations

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.rest_spread import SAMPLES, SOURCES, Spread
from mitsuba_taxel.evidence.paper.page.words import paragraph


def rest_section(spread: Spread) -> str:
    """The section of the page of measured sensors on the spread of the voltages at rest."""
    rows = [[name, spread.laws[name], SOURCES[name], f"{100 * spread.shares[name]:.1f}"] for name in SOURCES]
    return f"""\
## Spread of the voltages at rest
One cell of the pad is computed {SAMPLES} times, with parameters drawn from the distributions below
(`taxel tolerance` with a study that is written to DIR/tolerance). Values called *assumed* have no source: the
tolerances of that board, grid and mould are not published. The limits of the current of the NJL5908AR are not published
either; those of another part are used.

{markdown_table(["parameter", "distribution", "what, and source", "share of the variance [%]"], rows)}

{paragraph(_words(spread))}
"""


def _words(spread: Spread) -> str:
    low, high, actual = spread.without_gain, spread.all, measured.REST_SPREAD
    inside = low <= actual <= high
    bottom, top = measured.REST_VOLTAGES
    figures = (
        f"The standard deviation of the reading at rest, in percent of its mean, is **{high:.0f} ± "
        f"{spread.all_error:.0f} % with all parameters**, {low:.0f} ± {spread.without_gain_error:.0f} % without the "
        f"gain of the parts, and {actual:g} % as measured among 25 taxels (from {bottom:g} to {top:g} V). Errors are "
        "due to the finite number of samples, and contain the noise of the light; at rest, elements and time steps "
        "cause no error. The measured spread "
        f"{'lies between the two' if inside else '**does not lie between the two**'}"
    )
    gain = spread.gain_for(actual)
    if not inside:
        return f"{figures}."
    narrower = "is narrower than" if gain < spread.gain else "is **not** narrower than"
    return (
        f"{figures}: with the other tolerances as assumed, a gain that varies by {gain:.0f} % would explain it. That "
        f"{narrower} the {spread.gain:.0f} % of the datasheet, as parts of one delivery usually are. This is not a "
        f"test of the model, because many sets of tolerances lead to the same number."
    )
