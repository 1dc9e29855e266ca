"""A section of the page of measured sensors: what else was assumed of the pad, and what that changed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.pad_assumptions import PREDICTED, Tried, expected_at, rings
from mitsuba_taxel.evidence.measured.pad_comparison import Compared, Results
from mitsuba_taxel.evidence.paper.page.words import paragraph


def assumptions_section(found: Results, tried: Mapping[str, Tried]) -> str:
    """The section of the page."""
    fitted = measured.PRESSED
    heads = ["assumed", f"force of {fitted} [%]", f"change of {fitted} [%]", *("1", "1.4", "2", "2.2", "2.8")]
    rows = [["measured", "", "", *_shown(rings(np.array(measured.HELD_MAP)))]]
    rows += [["as above", *_errors(found.taxels[fitted]), *_shown(rings(found.centred))]]
    rows += [[words, *_errors(one.fitted), *_shown(one.rings)] for words, one in tried.items()]
    return f"""\
### What else may be so
Nothing is published of the following. One thing at a time, with the height and the indenter found above, and the
modulus and the begin of the record found anew: largest differences as above, and means of the map over all taxels at
the same distance from taxel {fitted}, in pitches. These hardly depend on where the indenter stands, which is over the
middle here.

{markdown_table(heads, rows)}

{paragraph(_own(found))}
"""


def _errors(one: Compared) -> list[str]:
    return [f"{errors[np.nanargmax(np.abs(errors))]:+.1f}" for errors in (one.force_error, one.change_error)]


def _shown(means: np.ndarray) -> list[str]:
    return [f"{mean:.1f}" for mean in means]


def _own(found: Results) -> str:
    """Whether the taxel that is missed most is missed alike in the map."""
    there, computed, expected = expected_at(found)
    times = f"Pressed itself, taxel {PREDICTED} changes {expected / computed:.2f} times as much as computed"
    if abs(expected - there) >= abs(computed - there):
        return f"{times}, but not so in the map while taxel {measured.PRESSED} is pressed."
    return (
        f"{times}, and so it does in the map while taxel {measured.PRESSED} is pressed: there, that makes "
        f"{expected:.0f} of {computed:.0f}, and measured is {there:.0f}. What is missed is its own, wherever the pad "
        "is pressed, and not how the pad deforms; the model knows no differences between taxels."
    )
