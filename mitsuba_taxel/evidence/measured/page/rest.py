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
{_words(spread)}

One cell of the pad is computed {SAMPLES} times, with parameters drawn from the distributions below (`taxel tolerance`
with a study that is written to DIR/tolerance). The table has a row for each parameter. Values called *assumed* have no
source: the tolerances of that board, grid and mould are not published. The limits of the current of the NJL5908AR are
not published either; those of another part are used. The last column has the share of the variance of the reading that
is due to the parameter:

{markdown_table(["parameter", "distribution", "what, and source", "share of the variance [%]"], rows)}
"""


def _words(spread: Spread) -> str:
    low, high, actual = spread.without_gain, spread.all, measured.REST_SPREAD
    inside = low <= actual <= high
    bottom, top = measured.REST_VOLTAGES
    answer = (
        "Two spreads of the voltage at rest are computed: with all tolerances of the parts and of their assembly, and "
        "without the tolerance of the gain. The measured spread **does not lie between the two**."
    )
    if inside:
        answer = (
            "Tolerances of the parts and of their assembly explain the spread of the measured voltages at rest: the "
            "measured spread lies between that computed with all tolerances and that computed without the tolerance "
            "of the gain."
        )
    figures = (
        f"- **{high:.0f} ± {spread.all_error:.0f} % with all parameters**,\n"
        f"- {low:.0f} ± {spread.without_gain_error:.0f} % without the gain of the parts,\n"
        f"- {actual:g} % as measured among 25 taxels (from {bottom:g} to {top:g} V)."
    )
    errors = (
        "Errors (±) are due to the finite number of samples, and contain the noise of the light. At rest, elements and "
        "time steps cause no error."
    )
    answer += " The standard deviation of the reading at rest, in percent of its mean, is"
    words = [paragraph(answer), figures, paragraph(errors)]
    gain = spread.gain_for(actual)
    if inside:
        narrower = "is narrower than" if gain < spread.gain else "is **not** narrower than"
        words.append(
            paragraph(
                f"With the other tolerances as assumed, a gain that varies by {gain:.0f} % would explain the measured "
                f"spread. That {narrower} the {spread.gain:.0f} % of the datasheet, as parts of one delivery usually "
                "are. This is not a test of the model, because many sets of tolerances lead to the same number."
            )
        )
    return "\n\n".join(words)
