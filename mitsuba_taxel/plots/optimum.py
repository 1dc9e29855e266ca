"""Plots of an optimisation: its history, figures, variables and pads before and after, and Pareto fronts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.plots.figures import COLOURS, label_with_prefix, panel_axes

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_optimum(figures: pandas.DataFrame, variables: pandas.DataFrame, history: pandas.DataFrame) -> Figure:
    """Plot the objective over the designs, and figures and variables of the first and the best design.

    Parameters
    ----------
    figures, variables, history : pandas.DataFrame
        Tables of an ``Optimum``.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    axes = panel_axes(1, 3, size=(4.6, 3.4), sharex=False)
    _draw_course(axes[0, 0], history, figures.iloc[0])
    names = [f"{row.figure} [{row.unit}]" if row.unit != "1" else row.figure for row in figures.itertuples()]
    scale = np.abs(figures.before.to_numpy())
    scale[scale == 0] = 1.0
    _draw_pairs(axes[0, 1], names, figures.before / scale, figures.best / scale)
    axes[0, 1].set_xlabel("figure, relative to before")
    width = variables.high - variables.low
    ends = [
        f"{name}\n{low:g} to {high:g}"
        for name, low, high in zip(variables.variable, variables.low, variables.high, strict=True)
    ]
    _draw_pairs(axes[0, 2], ends, *((variables[when] - variables.low) / width for when in ("before", "best")))
    axes[0, 2].set_xlim(-0.05, 1.05)
    axes[0, 2].set_xlabel("variable, within its bounds")
    axes[0, 2].legend(loc="best", frameon=True)
    return axes[0, 0].figure


def _draw_course(ax: Axes, history: pandas.DataFrame, goal: Any) -> None:
    from matplotlib.ticker import MaxNLocator

    name = goal.figure.split(" ", 1)[1]
    allowed = history.get("allowed", np.zeros(len(history))) == True  # noqa: E712  (others are missing)
    for rows, label, face in ((history[allowed], "allowed", COLOURS[0]), (history[~allowed], "not allowed", "none")):
        ax.scatter(rows.design, rows[name], 18, facecolors=face, edgecolors=COLOURS[0], label=label)
    ax.step(history.design, history.best, where="post", color=COLOURS[1], label="best so far")
    ax.set_xlabel("design")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    label_with_prefix([ax], name, goal.unit if goal.unit != "1" else "")
    ax.legend(loc="best", fontsize="small")


def _draw_pairs(ax: Axes, names: list[str], before: Any, best: Any) -> None:
    y = np.arange(len(names))[::-1]
    ax.hlines(y, before, best, color=COLOURS[4], linewidth=3)
    ax.scatter(before, y, 40, color=COLOURS[7], marker="o", label="before", zorder=3)
    ax.scatter(best, y, 40, color=COLOURS[1], marker="D", label="best", zorder=3)
    ax.set_yticks(y, [name.replace(" along ", "\nalong ") for name in names], fontsize="small")
    ax.margins(y=0.3)


def plot_sections(before: Pad, best: Pad) -> Figure:
    """Plot sections through a row of cells of two pads, at the same scale.

    Parameters
    ----------
    before, best : Pad
        Pads of both designs, with lengths in mm.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    from matplotlib.patches import Polygon

    ax = panel_axes(1, 1, size=(7.0, 3.4))[0, 0]
    styles: list[tuple[Pad, dict[str, Any]]] = [
        (best, {"facecolor": COLOURS[1], "alpha": 0.35, "label": "best"}),
        (before, {"fill": False, "edgecolor": COLOURS[7], "linestyle": "--", "linewidth": 1.5, "label": "before"}),
    ]
    for pad, about in styles:
        half, cell = 0.5 * pad.extent[0], pad.shape.section()
        cells = [cell + [x, 0.0] for x in sorted({x for x, _ in pad.cell_centres})]
        around = [[half, 0.0], [half, pad.height], [-half, pad.height], [-half, 0.0]]
        ax.add_patch(Polygon(np.concatenate([*cells, around]), **about))
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("z [mm]")
    ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return ax.figure


def plot_front(front: pandas.DataFrame, units: Sequence[str]) -> Figure:
    """Plot a Pareto front: the second objective against the first.

    Parameters
    ----------
    front : pandas.DataFrame
        Table ``front`` of an ``Optimum``; its first two columns are the objectives.
    units : Sequence[str]
        Units of the two objectives.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    axes = panel_axes(1, 1)
    ax = axes[0, 0]
    first, second = front.columns[:2]
    factor, unit = prefixed(float(front[first].abs().max()), "" if units[0] == "1" else units[0])
    ax.plot(front[first] / factor, front[second], "o-", color=COLOURS[0])
    ax.set_xlabel(f"{first} [{unit}]" if unit else first)
    label_with_prefix([ax], second, "" if units[1] == "1" else units[1])
    return axes[0, 0].figure
