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

This section uses the pad and the indenter found above, now with viscoelastic silicone. The modulus found above is the
long-term modulus, because the pad was pressed slowly. The light is computed for each state of the pad.

Errors (±) are those of the computation: the difference from elements of {FINER:g} mm, the estimated error of the time
steps, and the noise of the light.

### Voltage after release, fitted
The largest difference between computed and measured voltages is {worst:.0f} % of the measured value. Only these
voltages are fitted.

The fitted weights of three relaxation times are {series}. The fit needed {fit.paths} load paths by finite elements. In
the computation, the indenter is withdrawn instantly. In the measurement, this takes time, so that the first weight is
due to the withdrawal as much as to the silicone.

The table has a row for each time after release. It shows the change of the voltage that remains, in percent of the
change during the hold:

{markdown_table(["s after release", "measured", "fitted"], tail_rows)}

### Force during the hold, predicted
{paragraph(_hold_words(fit, forces, scatters))}

The table has a row for each time window, in seconds after the travel was reached. It shows the force relative to the
force at the end of the hold. The errors of measured values are the scatter within the window:

{markdown_table(["s", "measured", "computed"], hold_rows)}

### Hysteresis loops, predicted
{_loop_words(fit)}

The table has the results of a loading cycle to {travel} in {duration}. A row has the width of a hysteresis loop, in
percent of the largest force or change; the row of the energy has the energy loss, in percent of the energy of loading.
The last column is for an elastic pad under an indenter with an assumed coefficient of friction of {FRICTION:g}; its
error is not computed:

{markdown_table(["loop", "measured", "viscoelastic", "elastic, with friction"], loop_rows)}
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
        f"ones{unresolved}."
    )
    friction = (
        f"**Friction** below the indenter explains {memory.rubbed.force:.2f} of the {measured.FORCE_LOOP:g} % by which "
        f"the force differs on the way back. It changes the largest force by {100 * (memory.stiffer - 1):+.0f} %."
    )
    linear_note = (
        "**Errors of the computation** do not explain it: in closed form, the loop of the force of a linear solid with "
        f"the fitted series is {linear_loop(memory.terms):.2f} % wide."
    )
    sentences = [verdict, friction]
    if low > ALIKE:
        sentences += [linear_note, _slower_term(), *_widths_alone()]
    return "\n\n".join(map(paragraph, sentences))


def _slower_term() -> str:
    """Sentences about a further term of the Prony series, which could widen loops that are too narrow."""
    time, residue = slow_term()
    there = measured_tail()[-1]
    verdict = "does not exclude it"
    if residue > ALIKE * there:
        verdict = (
            "excludes it. Several terms leave at least as much, because both the widths and the remainders of terms "
            "with small weights add up: no linear viscosity explains both records"
        )
    return (
        "**A further term of the series** could widen the loop so far, best with a relaxation time of "
        f"{time:.0f} s. In a linear solid, this term would leave at least {100 * residue:.1f} % of the change "
        f"{measured.TAIL_TIMES[-1]:g} s after the release, but {100 * there:.2f} % was measured: that {verdict}."
    )


def _widths_alone() -> list[str]:
    """Paragraphs about possible causes of the loops that the measured widths alone exclude, if changes of voltage and
    force are proportional to travel."""
    force, at_travel, at_force = measured.FORCE_LOOP, measured.VOLTAGE_LOOP_AT_TRAVEL, measured.VOLTAGE_LOOP_AT_FORCE
    play = at_travel / 100 * measured.PRESSES[measured.PRESSED].travels[-1]
    lower, higher = abs(force - at_travel), force + at_travel
    less = abs(lower - at_force) < abs(higher - at_force)
    return [
        f"**The roofs are {'less' if less else 'more'} pressed on the way back**, at equal travel. The widths show "
        "this if voltage and force are nearly proportional to each other and to the travel. On the way back, the force "
        f"is lower by {force:g} %. At equal travel, the voltage differs by {at_travel:g} %. If it is lower on the way "
        f"back, it should be {lower:.1f} % higher at equal force; if it is higher, it should be {higher:.1f} % higher "
        f"at equal force. {at_force:g} % was measured, which is nearer to the {'first' if less else 'second'}.",
        "**Not the only cause:** softening or relaxation that is the same everywhere, because it does not change the "
        f"shape of a pad at a given travel. Also excluded are play of the robot (it would be {play:.2f} mm) and slip "
        "of the pad, because they change nothing at equal force. An elastic compliance of the robot causes no loop.",
        "**Possible causes:** softening by the first strain (Mullins' effect), if it is larger below the indenter than "
        f"at the roofs; or a softening by {min(lower, at_force):.0f} to {max(lower, at_force):.0f} % together with "
        "play or slip. These data do not show which. The next section computes the first.",
    ]
