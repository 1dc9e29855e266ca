"""Plots of distance curves of photo-reflectors: measured and computed currents, and differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.parts import Part, distance_model
from mitsuba_taxel.plots.figures import COLOURS, panel_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_part_fit(part: Part, model: np.ndarray) -> Figure:
    """Plot the measured curve of a part, the computed curve, and their difference, against the height.

    Parameters
    ----------
    part : Part
        Part with a distance curve of N rows.
    model : (N,) ndarray
        Computed currents of the rows, relative to the largest measured current.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    ((curve, residual),) = panel_axes(1, 2, size=(4.6, 3.6))
    heights, currents = np.array(part.distance_curve).T
    fine = np.geomspace(heights.min(), heights.max(), 60)
    rows = distance_model(part, heights)
    scale = (rows @ model) / (rows @ rows)
    curve.plot(fine, 100 * scale * distance_model(part, fine), color=COLOURS[0], label="these dies")
    curve.plot(heights, 100 * currents, "o", color=COLOURS[1], markersize=4, label="measured")
    curve.set_ylabel("current [% of the largest]")
    curve.set_title(part.title, fontsize="medium")
    curve.legend(fontsize="small")
    residual.plot(heights, 100 * (model - currents), "o", color=COLOURS[1], markersize=4)
    residual.axhline(0, color="black", lw=0.8)
    residual.set_ylabel("computed - measured [% of the largest]")
    for ax in (curve, residual):
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_xlabel(f"height of the {part.distance_reflector} above the windows [mm]")
    return curve.figure
