"""Section of the page of measured sensors: Mullins' effect as a possible cause of the hysteresis loops of the pad."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured import measured, softening
from mitsuba_taxel.evidence.measured.memory_fit import FRICTION, HysteresisLoop, PronyFit
from mitsuba_taxel.evidence.measured.softening import MESH_SIZE, SofteningFit, fit, loop_of
from mitsuba_taxel.evidence.paper.page.words import paragraph
from mitsuba_taxel.evidence.paper.scenes import YOUNGS_MODULUS

BETAS = (0.1, 0.5, 1.0)
PLAYS = (0.02, 0.04)
"""Play or slip in mm that is added to Mullins' effect."""
ALLOWED, PREDICTED = 1.5, 2.5
"""Differences in percent that count as agreement: of the fitted and of the predicted taxels."""

_WIDTHS = ("force", "energy", "voltage at equal force", "voltage at equal travel")


class LoopExplanation(NamedTuple):
    """Causes that together may explain the hysteresis loops: their name, the fit of Mullins' effect to taxel 13, and
    the predicted widths of the loops of other taxels, by their number.
    """

    name: str
    fitted: SofteningFit
    predicted: dict[int, HysteresisLoop]

    @property
    def miss(self) -> float:
        """Largest difference between the computed and the measured widths of taxel 13, in percent."""
        return float(np.abs(np.subtract(self.fitted.loop, softening.MEASURED)).max())


def explanations(studies: Mapping[int, xr.Dataset], memory: PronyFit) -> list[LoopExplanation]:
    """Fit Mullins' effect alone, and together with other causes, to taxel 13, and predict the other taxels.

    Widths by friction and by relaxation are those computed for taxel 13.
    """
    reversed_voltage = memory.rubbed._replace(
        change_at_force=-memory.rubbed.change_at_force, change_at_travel=-memory.rubbed.change_at_travel
    )
    causes = [
        ("alone", None, 0.0, softening.NOTHING),
        *((f"alone, beta = {beta:g}", beta, 0.0, softening.NOTHING) for beta in BETAS),
        *((f"with play or slip of {play:g} mm", None, play, softening.NOTHING) for play in PLAYS),
        (f"with a coefficient of friction of {FRICTION:g}", None, 0.0, memory.rubbed),
        ("likewise, voltages of the other sign", None, 0.0, reversed_voltage),
        ("with relaxation", None, 0.0, memory.loop),
    ]
    found = []
    for name, beta, play, others in causes:
        fitted = fit(studies[measured.PRESSED], beta, play, others)
        predicted = {
            taxel: HysteresisLoop(*np.add(loop_of(study, fitted.constants, play), others).tolist())
            for taxel, study in studies.items()
            if taxel != measured.PRESSED
        }
        found.append(LoopExplanation(name, fitted, predicted))
    return found


def softening_section(studies: Mapping[int, xr.Dataset], paper_study: xr.Dataset, memory: PronyFit) -> str:
    """The section of the page of measured sensors on Mullins' effect, from the first loadings of taxels, by their
    number, and of a cell of the paper.
    """
    found = explanations(studies, memory)
    rows = [["measured", "", "", "", *(f"{width:g}" for width in softening.MEASURED)]]
    for each in found:
        r, m, beta = each.fitted.constants
        rows.append([each.name, f"{r:.3g}", f"{m:.2g}", f"{beta:.2g}", *(f"{width:.2f}" for width in each.fitted.loop)])
    taxels = [taxel for taxel in studies if taxel != measured.PRESSED]
    heads = ["Mullins' effect", *(f"{taxel}: {_WIDTHS[0]}" if not k else name for taxel in taxels
             for k, name in enumerate(_WIDTHS))]  # fmt: skip
    predictions = [
        [each.name, *(f"{width:.1f}" for taxel in taxels for width in each.predicted[taxel])] for each in found
    ]
    return f"""\
## The same loop by Mullins' effect
{paragraph(_answer(found[0]))}

**What is computed.** A silicone with Mullins' effect is softer on unloading than in its first loading
([law](theory/mechanics.md#mullins-effect)). The loops are those of **one cell** of the pad under the indenter found
above, on elements of {MESH_SIZE:g} mm. Three simplifications are made: the softening is computed to first order, the
mean displacement of the roof represents the voltage, and no light is computed.

**Other causes** are added to Mullins' effect in some rows of the table. With *play* of the robot or *slip* of the pad,
the pad is pressed less at equal travel on unloading. *Friction* of the indenter and *relaxation* of the silicone have
the widths of the table above. The sign of the voltage by friction is not known, so that both signs are tried.

**Fitted to taxel {measured.PRESSED}.** A row has the constants r, m (relative to Young's modulus E) and beta that fit
the four measured widths best, and the widths with these constants, in percent. The width of a voltage is positive if,
on unloading, the voltage is lower at equal travel or higher at equal force, as the measured widths suggest:

{markdown_table(["Mullins' effect", "r", "m / E", "beta", *_WIDTHS], rows)}

{paragraph(_fitted_words(found, memory))}

{paragraph(_announced(taxels))}

{markdown_table(heads, predictions)}

{paragraph(_predicted_words(found))}

{paragraph(_creep_words(found, memory))}

{paragraph(_paper_words(found[0], paper_study))}
"""


def _answer(alone: LoopExplanation) -> str:
    can = alone.miss <= ALLOWED
    text = (
        f"Mullins' effect alone {'can' if can else '**cannot**'} explain the loops: with three fitted constants, it "
        f"gives the four measured widths to {alone.miss:.2f} percentage points."
    )
    doubt = (
        "This is not a proof. Three constants are fitted to four numbers, and it is not known whether the recorded "
        "cycle was the first one: in later cycles this law has no loop."
    )
    return f"{text} {doubt}" if can else text


def _announced(taxels: list[int]) -> str:
    numbers = " and ".join(map(str, taxels))
    return (
        f"**Predicted for taxels {numbers}** with these constants. Each taxel is pressed to its largest force; taxel "
        f"{softening.CORNER} is computed with the four cells of the corner. This program has no measured widths of "
        f"these taxels, so that nothing is compared. A measurement agrees if it differs by at most {PREDICTED:g} "
        "points:"
    )


def _fitted_words(found: list[LoopExplanation], memory: PronyFit) -> str:
    alike = _alike(found)
    if not alike:
        return (
            f"No row agrees with all four measured widths to {ALLOWED:g} points; the best one differs by "
            f"{min(each.miss for each in found):.1f}."
        )
    worst = max(alike, key=lambda each: each.miss)
    rest = memory.rubbed.change_at_force + memory.loop.change_at_force
    return (
        f"{len(alike)} of the {len(found)} rows agree with all four measured widths to {ALLOWED:g} points (the worst "
        f"of these to {worst.miss:.1f}). These explanations fit equally well. So the widths determine neither beta nor "
        "the contributions of friction, play and relaxation. Without Mullins' effect, friction, relaxation and play "
        f"together make the loop of the voltage at equal force at most {rest:.1f} % wide."
    )


def _predicted_words(found: list[LoopExplanation]) -> str:
    alike = _alike(found)
    if not alike:
        return "No explanation fits, so that these predictions are not expected to hold."
    spreads = {
        taxel: np.ptp([each.predicted[taxel] for each in alike], axis=0).max() for taxel in found[0].predicted
    }
    shown = " and ".join(f"{spread:.1f} points for taxel {taxel}" for taxel, spread in spreads.items())
    apart = max(spreads.values()) > PREDICTED
    return (
        f"The predictions of the explanations that fit equally well differ by at most {shown}. A measurement of these "
        f"loops would {'distinguish some of them' if apart else 'not distinguish them'}. It would test the model as a "
        "whole, because no constant is left to fit."
    )


def _alike(found: list[LoopExplanation]) -> list[LoopExplanation]:
    """The explanations that agree with all four measured widths."""
    return [each for each in found if each.miss <= ALLOWED]


def _creep_words(found: list[LoopExplanation], memory: PronyFit) -> str:
    r = found[0].fitted.constants[0]
    before, after = softening.creep(memory, 1.0), softening.creep(memory, 1 - 1 / r)
    weights = ", ".join(f"{weight:.3f}" for weight in after.weights)
    return (
        "**The record after release.** The voltage after release and the force during the hold agree with Mullins' "
        f"effect as well as without it. The softening is at most 1 / r = {100 / r:.0f} %, and it does not deform a pad "
        "at rest. It was tried in a linear solid whose long-term spring is softened by as much. The weights of the "
        f"relaxation times, fitted again, are {weights}. Computed voltages after release then differ from the measured "
        f"ones by at most {100 * after.misfit:.0f} % of these, and by {100 * before.misfit:.0f} % without the effect. "
        f"The force in the first second of the hold, relative to that at its end, is {after.hold:.3f}, and "
        f"{before.hold:.3f} without the effect; {measured.HOLD_FORCES[0][0] / measured.HOLD_FORCES[-1][0]:.3f} ± "
        f"{measured.HOLD_FORCES[0][1] / measured.HOLD_FORCES[-1][0]:.3f} was measured. If the softening also acts on "
        "the relaxing stress, the voltage after release does not change."
    )


def _paper_words(alone: LoopExplanation, study: xr.Dataset) -> str:
    r, m, beta = alone.fitted.constants
    width = softening.hysteresis_under_force(study, (r, m * YOUNGS_MODULUS, beta))
    values = " / ".join(f"{value:g}" for value in measured.MEASURED_HYSTERESIS.values())
    return (
        f"**The paper's hysteresis** is {values} % for parallelepiped, spherical and hemispheric cells. The constants "
        f"of the first row give {width:.1f} % for one parallelepiped cell of the paper, under the force per cell of "
        "its experiments. This assumes that its silicone softens alike, and that its cycle was a first one, which is "
        "not known. Round cells are not predicted: their reading falls and rises again under load, so that the "
        "displacement of the roof does not represent it."
    )
