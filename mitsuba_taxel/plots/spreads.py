"""Plots of tolerances: spread of each taxel, and the parameters that cause it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.plots.figures import COLOURS, axes_of

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = {
    "rest": "reading at rest",
    "sensitivity": "sensitivity",
    "noise_force": "noise as a force",
    "saturation_force": "saturation force",
    "crosstalk": "cross-talk",
}


def plot_spreads(spread: pandas.DataFrame, parameters: pandas.DataFrame) -> Figure:
    """Plot a tolerance study: two panels for each figure of merit, the spread of each taxel and the causes.

    The left panel shows, for each taxel and relative to the nominal value, a bar between the 5 and 95 % quantiles of
    the samples, the mean, and one standard deviation, of the samples and from derivatives. If some samples are linear
    estimates, the ends of the bar have standard errors. The right panel shows the total Sobol' indices of the
    parameters.

    Parameters
    ----------
    spread, parameters : pandas.DataFrame
        Tables of a ``Tolerance``.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    names = list(dict.fromkeys(spread.figure))
    grid = axes_of((10.5, 2.6 * len(names) + 0.5), len(names), 2)
    for (spread_ax, share_ax), name in zip(grid, names, strict=True):
        _draw_spread(spread_ax, spread[spread.figure == name], name)
        _draw_parameters(share_ax, parameters, name)
    grid[-1, 0].set_xlabel("taxel")
    grid[-1, 1].set_xlabel("total Sobol' index, mean of the taxels")
    figure = grid[0, 0].figure
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4, frameon=False)
    return figure


def _draw_spread(ax: Axes, rows: pandas.DataFrame, name: str) -> None:
    x, unit = np.arange(len(rows)), 100 / rows.nominal.replace(0.0, np.nan).to_numpy()
    low, high, mean = ((rows[column] - rows.nominal).to_numpy() * unit for column in ("low", "high", "mean"))
    ax.use_sticky_edges = False
    ax.bar(x, high - low, bottom=low, width=0.7, color=COLOURS[4], label="5 to 95 % of the samples")
    if "low_error" in rows:
        for end, error, label in ((low, rows.low_error, "standard error of these ends"), (high, rows.high_error, None)):
            ax.errorbar(x, end, error * abs(unit), fmt="none", ecolor="grey", capsize=4, label=label)
    ax.errorbar(x - 0.12, mean, rows.sd * abs(unit), fmt="o", color=COLOURS[0], markersize=4, label="mean and 1 sigma")
    if rows.linear_sd.notna().any():
        zero, linear = np.zeros(len(rows)), rows.linear_sd * abs(unit)
        ax.errorbar(x + 0.12, zero, linear, fmt="s", color=COLOURS[1], markersize=3, label="1 sigma, linear")
    ax.axhline(0, color="black", linewidth=0.6)
    ax.set_xlim(-1, len(rows))
    ax.set_xticks(x, rows.taxel.astype(str))
    ax.set_ylabel(f"{TITLES[name]}\n[% of nominal]")
    ax.grid(axis="y", alpha=0.3)


def _draw_parameters(ax: Axes, parameters: pandas.DataFrame, name: str) -> None:
    rows = parameters.iloc[::-1]
    ax.barh(rows.parameter, rows[f"total_{name}"], color=COLOURS[2])
    ax.set_xlim(0, max(1.0, rows[f"total_{name}"].max()))  # NaN where unknown
    ax.grid(axis="x", alpha=0.3)
