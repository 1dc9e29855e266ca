"""Plot of an exported model of readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.plots.figures import MOST_LINES, MOST_PANELS, label_with_prefix, legend_beside, panel_axes, style
from mitsuba_taxel.surrogates.polynomial import Polynomial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLACES = 101
"""Number of values of an input at which the model is evaluated."""


def plot_model(model: Polynomial, narrow: bool = False) -> Figure:
    """Plot readings of the taxels against each input of a model, with the other inputs in the middle of their ranges.

    If there are many taxels, only the taxels whose readings change most are shown.

    Parameters
    ----------
    model : Polynomial
        The exported model.
    narrow : bool
        Whether the plot is narrow, for a phone.
    """
    low, high = model.low, model.high
    middle = (low + high) / 2
    varied = [number for number in range(len(low)) if high[number] > low[number]][:MOST_PANELS]
    lines = []
    for number in varied:
        inputs = np.tile(middle, (PLACES, 1))
        inputs[:, number] = np.linspace(low[number], high[number], PLACES)
        lines.append((inputs[:, number], model(inputs)))
    change = np.max([np.ptp(readings, axis=0) for _, readings in lines], axis=0)
    shown = np.sort(np.argsort(-change, kind="stable")[:MOST_LINES])
    axes = panel_axes(1, len(varied), size=(4.6, 3.2), sharex=False, narrow=narrow)
    for ax, number, (x, readings) in zip(axes.flat, varied, lines, strict=True):
        for row, taxel in enumerate(shown.tolist()):
            look: dict[str, Any] = {**style(row), "marker": ""}
            ax.plot(x, readings[:, taxel], label=str(taxel + 1), linewidth=1.2, **look)
        name, unit = model.names[number], model.units[number]
        ax.set_xlabel(f"{name} [{unit}]" if unit not in ("", "1") else name)
    label_with_prefix(axes.flat, "optical power", "W")
    legend_beside(axes.flat[0].figure, axes.flat, "taxel")
    return axes.flat[0].figure
