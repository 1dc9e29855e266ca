"""Section of the page of measured sensors: the effects of other assumptions about the pad."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.pad_assumptions import PREDICTED, AssumptionResult, expected_at, rings
from mitsuba_taxel.evidence.measured.pad_comparison import PadComparison, TaxelComparison
from mitsuba_taxel.evidence.paper.page.words import paragraph


def assumptions_section(results: PadComparison, tried: Mapping[str, AssumptionResult]) -> str:
    """The section of the page of measured sensors on other assumptions about the pad."""
    fitted = measured.PRESSED
    heads = ["assumed", f"force of {fitted} [%]", f"change of {fitted} [%]", *("1", "1.4", "2", "2.2", "2.8")]
    rows = [["measured", "", "", *_shown(rings(np.array(measured.HELD_MAP)))]]
    rows += [["as above", *_errors(results.taxels[fitted]), *_shown(rings(results.centred))]]
    rows += [[name, *_errors(outcome.fitted), *_shown(outcome.rings)] for name, outcome in tried.items()]
    return f"""\
### Other assumptions
Some properties of the pad are not published. The table shows the effect of other assumptions about them. Each row has
one assumption that is changed, except for the rows *measured* and *as above*. The height and the indenter are those
found above; the modulus and the start of the record are fitted again.

- The columns *force* and *change* have the largest differences between computed and measured values, as above.
- A column with a number has means of the map. The number is a distance from taxel {fitted} in pitches; the mean is that
  of all taxels at this distance. These means hardly depend on the position of the indenter, which is above the middle
  in these computations.

{markdown_table(heads, rows)}

{paragraph(_own(results))}
"""


def _errors(compared: TaxelComparison) -> list[str]:
    return [f"{errors[np.nanargmax(np.abs(errors))]:+.1f}" for errors in (compared.force_error, compared.change_error)]


def _shown(means: np.ndarray) -> list[str]:
    return [f"{mean:.1f}" for mean in means]


def _own(results: PadComparison) -> str:
    """Sentences that compare two errors of the worst predicted taxel: in the map of all taxels, and when the taxel
    itself is pressed."""
    actual, computed, expected = expected_at(results)
    factor = f"{expected / computed:.2f}"
    times = f"When taxel {PREDICTED} is pressed itself, its voltage changes {factor} times as much as computed"
    if abs(expected - actual) >= abs(computed - actual):
        return f"{times}, but not so in the map while taxel {measured.PRESSED} is pressed."
    return (
        f"{times}. The same factor holds in the map, while taxel {measured.PRESSED} is pressed: it turns the computed "
        f"change of {computed:.0f} into {expected:.0f}, and {actual:.0f} was measured. This would be a property of the "
        f"taxel; but while taxel {PREDICTED} is held, its neighbours, too, change more than computed, as said above. "
        "So it is one of this part of the pad, at least in part; in the model all parts are equal."
    )
