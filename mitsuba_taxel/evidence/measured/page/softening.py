"""Section of the page of measured sensors: Mullins' effect as a possible cause of the hysteresis loops of the pad."""

from __future__ import annotations

import xarray as xr

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured.softening import MEASURED, MESH_SIZE, fit
from mitsuba_taxel.evidence.paper.page.words import paragraph

BETAS = (0.1, 0.5, 1.0)
ALLOWED = 1.5
"""Difference in percent that counts as agreement."""

_HEADS = ("beta", "r", "m / E", "force", "energy", "voltage at equal force", "voltage at equal travel")


def softening_section(study: xr.Dataset) -> str:
    """The section of the page of measured sensors on Mullins' effect, from the data of :func:`first_loading`."""
    free, fits = fit(study), {beta: fit(study, beta) for beta in BETAS}
    rows = [["measured", "", "", *(f"{width:g}" for width in MEASURED)]]
    for label, fitted in (("free", free), *((f"{beta:g}", fitted) for beta, fitted in fits.items())):
        r, m, beta = fitted.constants
        shown = f"{label}: {beta:.2g}" if fitted is free else label
        rows.append([shown, f"{r:.3g}", f"{m:.2g}", *(f"{width:.2f}" for width in fitted.loop)])
    worst = {beta: max(abs(a - b) for a, b in zip(each.loop, MEASURED, strict=True)) for beta, each in fits.items()}
    best = max(abs(a - b) for a, b in zip(free.loop, MEASURED, strict=True))
    alike = [f"{beta:g}" for beta, miss in worst.items() if miss <= ALLOWED]
    fitted_words = (
        f"With all three constants fitted, the computed widths differ from the measured ones by {best:.2f} points at "
        "most"
        + (f", and with beta = {', '.join(alike)} by {ALLOWED:g} points at most" if alike else "")
        + ": the widths hardly determine beta."
    )
    caveats = (
        "This is not a proof. Three constants are fitted to four numbers. It is not known whether the recorded cycle "
        "was the first one; after a first cycle, this law has no loop. Taxels 5 and 17 are not predicted yet. The "
        "creep after release needs relaxation in addition, which is not modelled together with this effect."
    )
    return f"""\
## The same loop by Mullins' effect
Mullins' effect alone is a possible cause of the loops: silicone is softer on the way back of its first cycle
([law](theory/mechanics.md#mullins-effect)). The constants of this law are fitted to the four measured widths.

{paragraph(fitted_words)}

{paragraph(caveats)}

The loops are those of **one cell** of that pad below the indenter found above, on elements of {MESH_SIZE:g} mm, to
first order in the softening. The mean displacement of the roof replaces the voltage; no light is computed.

The table has a row for each beta: fitted (*free*) or given. The columns r and m / E have the other fitted constants; E
is Young's modulus. The remaining columns have the widths in percent, as above. A width is positive if, on the way back,
the voltage is lower at equal travel and higher at equal force, as the measured widths suggest:

{markdown_table(_HEADS, rows)}
"""
