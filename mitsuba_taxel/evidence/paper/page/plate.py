"""Sections of the page on the paper: the photo-reflector under a mirror plate."""

from __future__ import annotations

import math
from pathlib import Path

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import figures, paper, plate
from mitsuba_taxel.evidence.paper.page.words import Found


def optics(studies: Found, pictures: Path) -> str:
    figures.plate_curves(studies["fig4"], "z", "z", "height z [mm]", pictures / "fig4.png")
    for figure, axis in (("fig5", "x"), ("fig6", "y")):
        label = f"edge distance along {axis} [mm]"
        figures.plate_curves(studies[figure], f"offset_{axis}", "edge", label, pictures / f"{figure}.png")
    return f"""\
## Figs. 4 to 6: the photo-reflector under a mirror plate
![Power over height](paper/fig4.png)

**Fig. 4.** Power, normalised to its largest, against height. The first height is {paper.HEIGHT_STEP:g} mm: at z = 0 the
plate lies on LED and phototransistor, no light passes, and the reading is 0. Grey: peak of the datasheet's curve.
Bands are two standard errors.

![Power over an edge along x](paper/fig5.png)
![Power over an edge along y](paper/fig6.png)

**Figs. 5 and 6.** The plate at {paper.EDGE_HEIGHT:g} mm covers everything beyond its edge. The edge distance is the
distance of the plate's edge from the edge of the package, counted inwards, along x from the LED's side: at 0 the whole
package is covered. (The paper speaks of "the space among the reflective plane and the photo-reflector edges".) """


def peaks(studies: Found, pictures: Path) -> str:
    peaks = plate.peaks(studies["peak"])
    figures.peak_positions(peaks, pictures / "peak.png")
    shown = [*plate.SPACINGS]
    rows = [
        [
            f"`{law}`",
            *(with_error(*by_spacing[spacing]) for spacing in shown),
            _within(plate.spacing_for(by_spacing, paper.PEAK_HEIGHT)),
        ]
        for law, by_spacing in peaks.items()
    ]
    head = ["LED", *(f"peak [mm] at {spacing:g} mm" for spacing in shown), "spacing [mm] for a peak at 0.30 mm"]
    low, high = min(plate.PEAK_SPACINGS), max(plate.PEAK_SPACINGS)
    return f"""\
### Die spacing and emission law cannot be distinguished
![Height of the peak](paper/peak.png)

{markdown_table(head, rows)}

The table has the height of the peak for each emission law and die spacing: the maximum of a cubic polynomial in ln z,
fitted to ln(power) where the power exceeds {plate.NEAR_PEAK:.0%} of its maximum. Die spacings are from {low:g} to
{high:g} mm, the range that fits into the package. The last column has the spacing with which each law reproduces the
peak of the datasheet. So the peak does not show which pair of law and spacing is right.
"""


def _within(spacing: plate.CurveMaximum) -> str:
    return with_error(*spacing) if math.isfinite(spacing.at) else "none"
