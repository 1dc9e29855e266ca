"""A section of the page of measured sensors: relaxation and loops of the pad under its indenter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.reproduce import measured, validation_figures
from mitsuba_taxel.reproduce.memory_fit import FRICTION, Memory, measured_tail
from mitsuba_taxel.reproduce.page_words import paragraph

_LOOPS = (
    ("force at equal travel", "force", measured.FORCE_LOOP),
    ("energy of a cycle", "energy", measured.ENERGY_LOST),
    ("voltage at equal force", "change_at_force", measured.VOLTAGE_LOOP_AT_FORCE),
    ("voltage at equal travel", "change_at_travel", measured.VOLTAGE_LOOP_AT_TRAVEL),
)


def memory_section(found: Memory, pictures: Path) -> str:
    """The section of the page; its figure is written to the folder ``pictures``."""
    left = measured_tail()
    forces, scatters = np.array(measured.HOLD_FORCES).T / measured.HOLD_FORCES[-1][0]
    tails, holds = 100 * np.array([left, found.tail]), np.array([forces, scatters, found.hold])
    validation_figures.memory(tails, holds, pictures / "memory.png")
    series = ", ".join(f"{share:.3f} in {time:g} s" for share, time in found.terms)
    tail_rows = [
        [f"{time:g}", f"{100 * a:.2f}", f"{100 * b:.2f}"]
        for time, a, b in zip(measured.TAIL_TIMES, left, found.tail, strict=True)
    ]
    hold_rows = [
        [f"{low:g} to {high:g}", f"{force:.3f} ± {scatter:.3f}", f"{ours:.3f}"]
        for (low, high), force, scatter, ours in zip(measured.HOLD_WINDOWS, forces, scatters, found.hold, strict=True)
    ]
    loop_rows = [
        [words, f"{there:g}", *(f"{getattr(loop, name):.2f}" for loop in (found.loop, found.rubbed))]
        for words, name, there in _LOOPS
    ]
    within = bool(np.all(np.abs(found.hold - forces) <= scatters))
    hold = "agrees within its scatter" if within else "does not agree within its scatter"
    worst = 100 * np.abs(found.tail / left - 1).max()
    travel = f"{max(measured.PRESSES[measured.PRESSED].travels):g} mm"
    duration = f"{measured.CYCLE_SECONDS:g} s"
    return f"""\
## The same pad: hold, release and loop
![Voltage after release, and force during the hold](validation/memory.png)

All of this is computed with the pad and the indenter found above, of viscoelastic silicone and with its light; the
modulus found is the long-term one, as the press was slow.

**Fitted to the voltage after release alone**, by {found.paths} paths of finite elements: the shares of three relaxation
times, {series}. Here the indenter is withdrawn at once, which takes time on the
bench: the first share is due to the release as much as to the silicone. Percent of the change during the hold:

{markdown_table(["s after release", "measured", "fitted"], tail_rows)}

The largest difference is {worst:.0f} % of the value.

Predicted: the force during the hold, relative to that at the end. Measured values with their scatter in the window.

{markdown_table(["s", "measured", "here"], hold_rows)}

The hold {hold}. From 0.5 s on its voltage changes by {100 * found.held_change:.2f} %; measured, by 0.15 % at most.

Predicted: a cycle to {travel} in {duration}. Widths in percent of the largest force or change, energy of that of
loading; beside them those of an elastic pad under an indenter with a coefficient of friction of {FRICTION:g}, which is
assumed:

{markdown_table(["loop", "measured", "viscoelastic", "elastic, with friction"], loop_rows)}

{paragraph(_loop_words(found))}
"""


def _loop_words(found: Memory) -> str:
    ratios = [there / getattr(found.loop, name) for _, name, there in _LOOPS]
    return (
        f"**The loop does not agree**: the measured ones are {min(ratios):.0f} to {max(ratios):.0f} times as wide "
        "as predicted. Relaxation within some seconds, all that tail and hold show, lags little in a cycle of "
        f"{measured.CYCLE_SECONDS:g} s, and a term slow enough to open such a loop would let the force of the "
        "hold fall by several percent more. Friction below the indenter opens none of this width either, though "
        f"it raises the largest force by {100 * (found.stiffer - 1):.0f} %. At equal travel nearly nothing but "
        "the shape of the pad determines the voltage, and yet the measured one differs: on the way back the pad "
        "did not have the shape it had on the way down. What is left, and not modelled, are softening by the "
        "first strain (Mullins' effect), and slip of the pad in its frame or of the walls on the collars."
    )
