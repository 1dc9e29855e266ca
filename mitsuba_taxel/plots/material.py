"""Plots of material tests: measured and fitted stress, residuals, and relaxation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.plots.figures import COLOURS, MARKERS, axes_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_material(
    curves: Sequence[Any], laws: Sequence[tuple[str, Sequence[np.ndarray]]], relaxation: Any = None
) -> Figure:
    """Plot the stress of material tests, and of the laws fitted to them, against strain.

    Parameters
    ----------
    curves : sequence of StressCurve
        Tests, drawn as points.
    laws : sequence of (str, sequence of ndarray)
        For each law, the best first: its name, and its stress in MPa at the rows of each curve.
    relaxation : RelaxationFit, optional
        Relaxation test, for a separate panel.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    panels = 3 if relaxation else 2
    ((above, *others),) = axes_of((4.6 * panels + 0.4, 4.0), 1, panels)
    residual = others[0]
    styles = ("-", "--", ":", "-.")
    for number, curve in enumerate(curves):
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
        order = np.argsort(curve.strain)
        strain = curve.strain[order]
        points: dict[str, Any] = {"linestyle": "", "marker": marker, "markersize": 3.5, "color": colour}
        above.plot(strain, curve.stress[order], **points, label=f"{curve.file} ({curve.mode})")
        for (name, stresses), line in zip(laws, styles, strict=False):
            grey = {"color": "black" if line == "-" else "0.5", "label": name if number == 0 else None}
            above.plot(strain, stresses[number][order], line, lw=1, **grey)
        best = laws[0][1][number]
        residual.plot(strain, 100 * (curve.stress - best)[order] / np.abs(curve.stress).max(), **points)
    above.set_ylabel("nominal stress [MPa]")
    above.legend(frameon=False, fontsize="small")
    above.set_title("points: measured; lines: laws", fontsize="medium")
    residual.axhline(0, color="black", lw=0.8)
    residual.set_ylabel("residual [% of the largest stress]")
    residual.set_title(laws[0][0], fontsize="medium")
    for ax in (above, residual):
        ax.set_xlabel("nominal strain")
        ax.grid(alpha=0.3)
    if relaxation:
        ax = others[1]
        positive = relaxation.time > 0
        ax.semilogx(relaxation.time[positive], relaxation.stress[positive], "o", markersize=3, color=COLOURS[0])
        ax.semilogx(relaxation.time[positive], relaxation.model[positive], "-", color="black", lw=1)
        ax.set_xlabel("time [s]")
        ax.set_ylabel("stress relative to the start")
        ax.set_title(f"{relaxation.file}: {len(relaxation.prony)} Prony terms", fontsize="medium")
        ax.grid(alpha=0.3)
    return above.figure
