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
The silicone of a first cycle is softer on the way back ([law](theory/mechanics.md#mullins-effect)). The table has the
loops of **one cell** of that pad below the indenter found above, on elements of {MESH_SIZE:g} mm, to first order in the
softening; the mean displacement of the roof stands for the voltage, and no light is computed. Widths are in percent, as
above; m is relative to Young's modulus E. Signs are those that the measured widths suggest: on the way back, the
voltage is lower at equal travel and higher at equal force. Other causes are added to it, to first order: play of the
robot or slip of the pad, by which the pad is pressed less at equal travel on the way back; friction of the indenter
and relaxation, with the widths of the table above. The signs of the voltages by friction are not known.

**Fitted to the four measured widths of taxel {measured.PRESSED}:**

{markdown_table(["Mullins' effect", "r", "m / E", "beta", *_WIDTHS], rows)}

{paragraph(_fitted_words(found, memory))}

{paragraph(_announced(taxels))}

{markdown_table(heads, predictions)}

{paragraph(_predicted_words(found))}

{paragraph(_creep_words(found, memory))}

{paragraph(_paper_words(found[0], paper_study))}
"""


def _announced(taxels: list[int]) -> str:
    numbers = " and ".join(map(str, taxels))
    return (
        f"**Predicted** with these constants: the loops of taxels {numbers}, each pressed to its largest force, taxel "
        f"{softening.CORNER} with the four cells of the corner. Their measured widths are not among the published "
        f"numbers that this program has, so they are not compared here; {PREDICTED:g} points are the limit of "
        "agreement:"
    )


def _fitted_words(found: list[LoopExplanation], memory: PronyFit) -> str:
    alike = [each for each in found if each.miss <= ALLOWED]
    worst = max(alike, key=lambda each: each.miss)
    rest = memory.rubbed.change_at_force + memory.loop.change_at_force
    return (
        f"With all three constants fitted, Mullins' effect alone meets the four widths to {found[0].miss:.2f} points. "
        f"{len(alike)} of the {len(found)} rows meet them to {ALLOWED:g} points, the worst of these to "
        f"{worst.miss:.1f}: explanations that fit equally well. So the widths determine neither beta nor a share of "
        "friction, play or relaxation. Without Mullins' effect, friction, relaxation and play together make the loop "
        f"of the voltage at equal force at most {rest:.1f} % wide. This is not a proof of Mullins' effect: three "
        "constants are fitted to four numbers; it is not known whether the recorded cycle was the first one, and after "
        "a first cycle this law has no loop."
    )


def _predicted_words(found: list[LoopExplanation]) -> str:
    alike = [each for each in found if each.miss <= ALLOWED]
    spreads = {
        taxel: np.ptp([each.predicted[taxel] for each in alike], axis=0).max() for taxel in found[0].predicted
    }
    shown = " and ".join(f"{spread:.1f} points for taxel {taxel}" for taxel, spread in spreads.items())
    apart = max(spreads.values()) > PREDICTED
    return (
        f"Among the explanations that fit equally well, the predicted widths differ by at most {shown}: their measured "
        f"loops would {'tell some of them apart' if apart else 'not tell them apart'}. They would test the model as a "
        "whole, because no constant is left."
    )


def _creep_words(found: list[LoopExplanation], memory: PronyFit) -> str:
    r = found[0].fitted.constants[0]
    before, after = softening.creep(memory, 1.0), softening.creep(memory, 1 - 1 / r)
    weights = ", ".join(f"{weight:.3f}" for weight in after.weights)
    return (
        f"**The record after release.** The softening is at most 1 / r = {100 / r:.0f} %, and a pad at rest is not "
        "deformed by it. In a linear solid whose long-term spring is softened by as much, the weights of the "
        f"relaxation times, fitted again, are {weights}, and the voltage after release is met to "
        f"{100 * after.misfit:.0f} % of the measured values instead of {100 * before.misfit:.0f} %. The force of the "
        f"first second of the hold is then {after.hold:.3f} instead of {before.hold:.3f} of that at its end; "
        f"{measured.HOLD_FORCES[0][0] / measured.HOLD_FORCES[-1][0]:.3f} ± "
        f"{measured.HOLD_FORCES[0][1] / measured.HOLD_FORCES[-1][0]:.3f} was measured. So the record after release and "
        "the hold agree with Mullins' effect as well as without it. If softening also acts on the relaxing stress, the "
        "voltage after release does not change."
    )


def _paper_words(alone: LoopExplanation, study: xr.Dataset) -> str:
    r, m, beta = alone.fitted.constants
    width = softening.hysteresis_under_force(study, (r, m * YOUNGS_MODULUS, beta))
    values = " / ".join(f"{value:g}" for value in measured.MEASURED_HYSTERESIS.values())
    return (
        f"**The paper's hysteresis** is {values} % for parallelepiped, spherical and hemispheric cells. For one "
        f"parallelepiped cell of the paper under the force per cell of its experiments, the constants of the first row "
        f"give {width:.1f} %, if its silicone softens alike. It is not known whether its cycle was a first one. "
        "For round cells the displacement of the roof does not stand for the reading, which falls and rises: "
        "they are not predicted."
    )
