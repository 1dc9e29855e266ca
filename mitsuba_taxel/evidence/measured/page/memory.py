"""A section of the page of measured sensors: relaxation and loops of the pad under its indenter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured import measured, validation_figures
from mitsuba_taxel.evidence.measured.memory_fit import FRICTION, PronyFit, linear_loop, measured_tail, slow_term
from mitsuba_taxel.evidence.measured.pad_comparison import FINER
from mitsuba_taxel.evidence.paper.page.words import paragraph

ALIKE = 1.1
"""Ratio of widths of loops that counts as agreement."""
RESOLVED = 2.0
"""Least width of a loop that is resolved, relative to its error."""

_LOOPS = (
    ("force at equal travel", "force", measured.FORCE_LOOP),
    ("energy of a cycle", "energy", measured.ENERGY_LOST),
    ("voltage at equal force", "change_at_force", measured.VOLTAGE_LOOP_AT_FORCE),
    ("voltage at equal travel", "change_at_travel", measured.VOLTAGE_LOOP_AT_TRAVEL),
)


def memory_section(fit: PronyFit, pictures: Path) -> str:
    """The section of the page; its figure is written to the folder ``pictures``."""
    tail = measured_tail()
    forces, scatters = np.array(measured.HOLD_FORCES).T / measured.HOLD_FORCES[-1][0]
    tails, holds = 100 * np.array([tail, fit.tail]), np.array([forces, scatters, fit.hold])
    validation_figures.memory(tails, holds, pictures / "memory.png")
    series = ", ".join(f"{weight:.3f} in {time:g} s" for weight, time in fit.terms)
    tail_rows = [
        [f"{time:g}", f"{100 * a:.2f}", _with(100 * b, 100 * error)]
        for time, a, b, error in zip(measured.TAIL_TIMES, tail, fit.tail, fit.errors.tail, strict=True)
    ]
    hold_rows = [
        [f"{low:g} to {high:g}", f"{force:.3f} ± {scatter:.3f}", f"{computed:.3f} ± {error:.3f}"]
        for (low, high), force, scatter, computed, error in zip(
            measured.HOLD_WINDOWS, forces, scatters, fit.hold, fit.errors.hold, strict=True
        )
    ]
    loop_rows = [
        [
            label,
            f"{observed:g}",
            _with(getattr(fit.loop, name), getattr(fit.errors.loop, name)),
            f"{getattr(fit.rubbed, name):.2f}",
        ]
        for label, name, observed in _LOOPS
    ]
    worst = 100 * np.abs(fit.tail / tail - 1).max()
    travel = f"{max(measured.PRESSES[measured.PRESSED].travels):g} mm"
    duration = f"{measured.CYCLE_SECONDS:g} s"
    return f"""\
## The same pad: hold, release and loop
![Voltage after release, and force during the hold](validation/memory.png)

All of this is computed with the pad and the indenter found above, of viscoelastic silicone and with its light; the
modulus found is the long-term one, as the press was slow. Errors are those of the computation: the difference to
elements of {FINER:g} mm, the estimated error of time steps, and the noise of the light.

**Fitted to the voltage after release alone**, by {fit.paths} paths of finite elements: the shares of three relaxation
times, {series}. Here the indenter is withdrawn at once, which takes time on the
bench: the first share is due to the release as much as to the silicone. Percent of the change during the hold:

{markdown_table(["s after release", "measured", "fitted"], tail_rows)}

The largest difference is {worst:.0f} % of the value.

Predicted: the force during the hold, relative to that at the end. Measured values with their scatter in the window.

{markdown_table(["s", "measured", "here"], hold_rows)}

{paragraph(_hold_words(fit, forces, scatters))}

Predicted: a cycle to {travel} in {duration}. Widths in percent of the largest force or change, energy of that of
loading; beside them those of an elastic pad under an indenter with a coefficient of friction of {FRICTION:g}, which is
assumed, and stated without an error:

{markdown_table(["loop", "measured", "viscoelastic", "elastic, with friction"], loop_rows)}

{paragraph(_loop_words(fit))}
"""


def _with(value: float, error: float) -> str:
    return f"{value:.2f} ± {error:.2f}"


def _hold_words(memory: PronyFit, forces: np.ndarray, scatters: np.ndarray) -> str:
    within = np.all(np.abs(memory.hold - forces) <= np.hypot(scatters, memory.errors.hold))
    hold = "agrees" if within else "**does not agree**"
    change, error = 100 * memory.held_change, 100 * memory.errors.held_change
    alike = "as" if change - error <= measured.HELD_CHANGE else "**not** as"
    if error > measured.HELD_CHANGE:
        alike = "which does not resolve what is"
    return (
        f"The hold {hold} within its scatter. From 0.5 s on its voltage changes by {_with(change, error)} %, {alike} "
        f"measured: by {measured.HELD_CHANGE:g} % at most."
    )


def _loop_words(memory: PronyFit) -> str:
    resolved = [
        entry for entry in _LOOPS if getattr(memory.loop, entry[1]) > RESOLVED * getattr(memory.errors.loop, entry[1])
    ]
    if not resolved:
        return "No width of the loop is resolved."
    ratios = [observed / getattr(memory.loop, name) for _, name, observed in resolved]
    low, high = min(ratios), max(ratios)
    unresolved = (
        f" ({len(_LOOPS) - len(resolved)} of {len(_LOOPS)} widths are not resolved)"
        if len(resolved) < len(_LOOPS)
        else ""
    )
    if 1 / ALIKE <= low and high <= ALIKE:
        return f"**The loop agrees** within {100 * (ALIKE - 1):.0f} %{unresolved}."
    verdict = (
        f"**The loop does not agree**: the measured ones are {low:.2g} to {high:.2g} times as wide as "
        f"predicted{unresolved}. Friction below the indenter opens {memory.rubbed.force:.2f} of "
        f"{measured.FORCE_LOOP:g} % and changes the largest force by {100 * (memory.stiffer - 1):+.0f} %."
    )
    linear_note = (
        "Of a linear solid with the fitted series, in closed form, that of the force is "
        f"{linear_loop(memory.terms):.2f} % wide: no error of the computation makes it narrow."
    )
    return f"{verdict} {linear_note} {_missing()}" if low > ALIKE else verdict


def _missing() -> str:
    """Sentences about effects that could widen loops that are too narrow."""
    time, residue = slow_term()
    there = measured_tail()[-1]
    verdict = "does not exclude it"
    if residue > ALIKE * there:
        verdict = (
            "excludes it. No sum of terms leaves less, as widths and remainders of small shares add up: no linear "
            "viscosity, whatever its constants, makes both records"
        )
    return (
        f"A further term of the series that opens such a loop, at best one of {time:.0f} s, would leave at least "
        f"{100 * residue:.1f} % of the change {measured.TAIL_TIMES[-1]:g} s after the release (a linear solid), where "
        f"{100 * there:.2f} % is measured: that {verdict}. {_widths_alone()}"
    )


def _widths_alone() -> str:
    """Sentences about what the measured widths exclude, if changes of voltage and force are proportional to travel."""
    force, at_travel, at_force = measured.FORCE_LOOP, measured.VOLTAGE_LOOP_AT_TRAVEL, measured.VOLTAGE_LOOP_AT_FORCE
    play = at_travel / 100 * measured.PRESSES[measured.PRESSED].travels[-1]
    lower, higher = abs(force - at_travel), force + at_travel
    less = abs(lower - at_force) < abs(higher - at_force)
    return (
        "The widths by themselves say more, if voltage and force are nearly proportional to each other and to travel. "
        f"The force lacks {force:g} % on the way back. If at equal travel the voltage is then lower by its "
        f"{at_travel:g} %, it is higher at equal force by {lower:.1f} %, and if it is higher, by {higher:.1f} %; "
        f"measured is {at_force:g} %. So roofs are {'less' if less else 'more'} pressed on the way back at equal "
        "travel. Softening or relaxation that is the same everywhere leaves the shape of a pad as it is at a given "
        f"travel, and is excluded as the only cause; so is play of the robot, which would be {play:.2f} mm, or slip of "
        "the pad: they change nothing at equal force. Give of the robot that is elastic opens no loop. What remains is "
        "softening by the first strain (Mullins' effect) that is larger below the indenter than at the roofs, or a "
        f"softening by {min(lower, at_force):.0f} to {max(lower, at_force):.0f} % together with play or slip; these "
        "data do not tell which, and none of it is modelled."
    )
