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

**Fig. 4** shows the power against the height of the plate. Powers are relative to the largest. Bands are two standard
errors. The grey line is at the peak of the datasheet's curve. The first height is {paper.HEIGHT_STEP:g} mm, because at
z = 0 the plate lies on LED and phototransistor, so that no light passes.

![Power over an edge along x](paper/fig5.png)
![Power over an edge along y](paper/fig6.png)

**Figs. 5 and 6** show the power against the edge distance. The plate is at {paper.EDGE_HEIGHT:g} mm and covers
everything beyond its edge. The edge distance is that of the plate's edge from the edge of the package, counted inwards:
at 0 the whole package is covered. Along x, it is counted from the side of the LED. (The paper speaks of "the space
among the reflective plane and the photo-reflector edges".) """


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

Different pairs of emission law and die spacing give the same height of the peak. So the peak of the datasheet does not
show which pair is right.

The table has a row for each emission law. It shows the height of the peak for several die spacings. The last column has
the die spacing for which the peak is at the height in the datasheet:

{markdown_table(head, rows)}

A peak is the maximum of a cubic polynomial in ln z, fitted to ln(power) where the power exceeds {plate.NEAR_PEAK:.0%}
of its maximum. Die spacings are from {low:g} to {high:g} mm, the range that fits into the package.
"""


def _within(spacing: plate.CurveMaximum) -> str:
    return with_error(*spacing) if math.isfinite(spacing.at) else "none"
