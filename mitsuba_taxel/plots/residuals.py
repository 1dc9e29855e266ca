"""Plots of fits: measured and modelled readings, residuals, and correlations of the unknowns."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.plots.figures import COLOURS, MARKERS, load_to_the_right

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NOT_SETTINGS = ("taxel", "unit", "measured", "model", "residual", "in_errors")


def plot_residuals(
    residuals: pandas.DataFrame, correlation: pandas.DataFrame, units: Mapping[str, str], loads: Collection[str]
) -> Figure:
    """Plot a fit: readings, residuals relative to their errors, and correlations of the unknowns.

    Measured readings are points, readings of the model are lines. They are drawn against the setting with the largest
    number of distinct values.

    Parameters
    ----------
    residuals, correlation : pandas.DataFrame
        Tables of a ``FitResult``.
    units : Mapping[str, str]
        Units of the settings that have one.
    loads : Collection[str]
        Names of the settings that are components of a load.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 5.5), dpi=150, layout="constrained")
    axes = figure.subplot_mosaic(
        [["readings", "correlation"], ["residuals", "correlation"]], width_ratios=(2, 1), height_ratios=(2, 1)
    )
    name, abscissa = _abscissa(residuals)
    for number, (taxel, rows) in enumerate(residuals.groupby("taxel")):
        colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
        x = abscissa[rows.index]
        order = np.argsort(x, kind="stable")
        measured: dict[str, Any] = {"linestyle": "", "marker": marker, "markersize": 4, "color": colour}
        axes["readings"].plot(x, rows.measured, label=str(taxel), **measured)
        axes["readings"].plot(x[order], rows.model.to_numpy()[order], color=colour, linewidth=0.8)
        axes["residuals"].plot(x, rows.in_errors, **measured)
    axes["readings"].set_title("points: measured; lines: model", fontsize="medium")
    axes["readings"].set_ylabel(f"reading [{residuals.unit.iloc[0]}]")
    axes["readings"].legend(title="taxel", frameon=False, fontsize="small")
    axes["residuals"].set_ylabel("residual\n[errors]")
    unit = units.get(name, "").removeprefix("1")
    axes["residuals"].set_xlabel(f"{name} [{unit}]" if unit else name)
    for ax in (axes["readings"], axes["residuals"]):
        if name in loads:
            load_to_the_right(ax, abscissa)
    axes["residuals"].axhspan(-2, 2, color=COLOURS[4], alpha=0.3)
    for ax in (axes["readings"], axes["residuals"]):
        ax.grid(alpha=0.3)
    _draw_correlation(axes["correlation"], correlation)
    return figure


def _abscissa(residuals: pandas.DataFrame) -> tuple[str, np.ndarray]:
    """Horizontal axis of a plot of a fit: the setting with most distinct values, or the row number, and its values."""
    settings = [name for name in residuals.columns if name not in NOT_SETTINGS]
    name = max(settings, key=lambda setting: residuals[setting].nunique(), default="")
    try:
        return name or "row", residuals[name].astype(float).to_numpy() if name else np.arange(len(residuals))
    except ValueError:  # words
        return "row", np.arange(len(residuals))


def _draw_correlation(ax: Axes, correlation: pandas.DataFrame) -> None:
    values = correlation.to_numpy()
    ax.imshow(np.nan_to_num(values), cmap="PuOr", vmin=-1, vmax=1)
    for (row, column), value in np.ndenumerate(values):
        colour = "white" if abs(value) > 0.6 else "black"
        ax.text(column, row, f"{value:.2f}", ha="center", va="center", color=colour, fontsize=8)
    ax.set_xticks(range(len(values)), correlation.columns, rotation=45, ha="right")
    ax.set_yticks(range(len(values)), correlation.index)
    ax.set_title("correlation of the unknowns", fontsize="medium")
