"""Section of the page of measured sensors: relaxation and hysteresis loops of the pad under its indenter."""

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
    """The section of the page of measured sensors on relaxation and hysteresis; its figure is written to the folder
    ``pictures``.
    """
    tail = measured_tail()
    forces, scatters = np.array(measured.HOLD_FORCES).T / measured.HOLD_FORCES[-1][0]
    tails, holds = 100 * np.array([tail, fit.tail]), np.array([forces, scatters, fit.hold])
    validation_figures.memory(tails, holds, pictures / "memory.png")
    series = ", ".join(f"{weight:.3f} for {time:g} s" for weight, time in fit.terms)
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

This section uses the pad and the indenter found above, now with viscoelastic silicone; the light is computed for each
state of the pad. The modulus found above is the long-term modulus, because the pad was pressed slowly. Errors are those
of the computation: the difference from elements of {FINER:g} mm, the estimated error of the time steps, and the noise
of the light.

**Fitted to the voltage after release alone.** The fitted weights of three relaxation times are {series}; the fit needed
{fit.paths} finite-element load paths. In the computation, the indenter is withdrawn instantly. In the measurement, this
takes time, so that the first weight is due to the withdrawal as much as to the silicone. The table has the change of
the voltage that remains after release, in percent of the change during the hold:

{markdown_table(["s after release", "measured", "fitted"], tail_rows)}

The largest difference is {worst:.0f} % of the measured value.

**Predicted:** the force during the hold, relative to the force at its end. The errors of measured values are the
scatter within each time window.

{markdown_table(["s", "measured", "computed"], hold_rows)}

{paragraph(_hold_words(fit, forces, scatters))}

**Predicted:** a loading cycle to {travel} in {duration}. The table has the widths of the hysteresis loops in percent of
the largest force or change, and the energy loss in percent of the energy of loading. The last column is for an elastic
pad under an indenter with an assumed coefficient of friction of {FRICTION:g}; its error is not computed:

{markdown_table(["loop", "measured", "viscoelastic", "elastic, with friction"], loop_rows)}

{paragraph(_loop_words(fit))}
"""


def _with(value: float, error: float) -> str:
    return f"{value:.2f} ± {error:.2f}"


def _hold_words(memory: PronyFit, forces: np.ndarray, scatters: np.ndarray) -> str:
    within = np.all(np.abs(memory.hold - forces) <= np.hypot(scatters, memory.errors.hold))
    hold = "agrees" if within else "**does not agree**"
    change, error = 100 * memory.held_change, 100 * memory.errors.held_change
    limit = f"{measured.HELD_CHANGE:g} %"
    alike = f"{'as' if change - error <= measured.HELD_CHANGE else '**not** as'} measured: by {limit} at most"
    if error > measured.HELD_CHANGE:
        alike = f"which does not resolve the measured change of at most {limit}"
    return (
        f"The hold {hold} within its scatter. From 0.5 s on its voltage changes by {_with(change, error)} %, {alike}."
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
        f"**The loop does not agree**: the measured widths are {low:.2g} to {high:.2g} times the predicted "
        f"ones{unresolved}. Friction below the indenter explains {memory.rubbed.force:.2f} of "
        f"the {measured.FORCE_LOOP:g} % and changes the largest force by {100 * (memory.stiffer - 1):+.0f} %."
    )
    linear_note = (
        "In closed form, the loop of the force of a linear solid with the fitted series is "
        f"{linear_loop(memory.terms):.2f} % wide, so the narrow loop is not an error of the computation."
    )
    return f"{verdict} {linear_note} {_missing()}" if low > ALIKE else verdict


def _missing() -> str:
    """Sentences about effects that could widen loops that are too narrow."""
    time, residue = slow_term()
    there = measured_tail()[-1]
    verdict = "does not exclude it"
    if residue > ALIKE * there:
        verdict = (
            "excludes it. Several terms leave at least as much, because both the widths and the remainders of terms "
            "with small weights add up: no linear viscosity explains both records"
        )
    return (
        f"A further term of the series could explain such a loop, best with a relaxation time of {time:.0f} s. In a "
        f"linear solid this term would leave at least {100 * residue:.1f} % of the change {measured.TAIL_TIMES[-1]:g} "
        f"s after the release, but {100 * there:.2f} % was measured: that {verdict}. {_widths_alone()}"
    )


def _widths_alone() -> str:
    """Sentences about possible causes of the loops that the measured widths alone exclude, if changes of voltage and
    force are proportional to travel."""
    force, at_travel, at_force = measured.FORCE_LOOP, measured.VOLTAGE_LOOP_AT_TRAVEL, measured.VOLTAGE_LOOP_AT_FORCE
    play = at_travel / 100 * measured.PRESSES[measured.PRESSED].travels[-1]
    lower, higher = abs(force - at_travel), force + at_travel
    less = abs(lower - at_force) < abs(higher - at_force)
    return (
        "The widths alone show more, if voltage and force are nearly proportional to each other and to the travel. On "
        f"the way back, the force is lower by {force:g} %. The loop of the voltage at equal "
        f"travel is {at_travel:g} % wide. If the voltage is lower there on the way back, it is {lower:.1f} % higher at "
        f"equal force; if it is higher there, it is {higher:.1f} % higher at equal force. {at_force:g} % was measured. "
        f"So roofs are {'less' if less else 'more'} pressed on the way back at equal travel. Softening or "
        "relaxation that is the same everywhere does not change the shape of a pad at a given travel, and is excluded "
        "as the only cause. Play of the robot (which would be "
        f"{play:.2f} mm) and slip of the pad are excluded as well, because they change nothing at equal force. An "
        "elastic compliance of the robot causes no loop. Possible causes are softening by the first strain (Mullins' "
        f"effect), if it is larger below the indenter than at the roofs, or a softening by {min(lower, at_force):.0f} "
        f"to {max(lower, at_force):.0f} % together with play or slip. These data do not show which; the next section "
        "computes the first."
    )
