"""Plots of work-precision diagrams: error against CPU seconds, with a panel for each part of the computation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_taxel.plots.figures import COLOURS, MARKERS, axes_of, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, WorkPoint

TITLES = {"optics": "light", "mechanics": "mechanics", "chain": "reading: light and mechanics"}
MOST_ACROSS = 4
LABELLED = ("mechanics", "chain")
"""Parts of the computation with few points, which are labelled."""


def plot_accuracy(
    curves: Sequence[ErrorCurve],
    title: str,
    folder: Path,
    titles: Mapping[str, str] = TITLES,
    labelled: Sequence[str] = LABELLED,
) -> None:
    """Plot work-precision curves, and write the figure as ``accuracy.png`` and ``accuracy.svg``.

    Filled markers are significant errors. Hollow markers lie below the error of the reference, which is a dashed line.
    Dotted lines, in labelled panels, are the errors that the method states.

    Parameters
    ----------
    curves : sequence of ErrorCurve
        The curves.
    title : str
        Title of the figure.
    folder : Path
        Output folder.
    titles : Mapping[str, str]
        Titles of the panels, by the part of the computation (``ErrorCurve.part``).
    labelled : sequence of str
        Parts of the computation whose points are labelled with their setting.
    """
    panels = [panel for panel in titles if any(curve.part == panel and curve.points for curve in curves)]
    columns = min(len(panels), MOST_ACROSS)
    rows = math.ceil(len(panels) / columns)
    axes = axes_of((6.4 * columns, 7.2 * rows), rows, columns)
    for ax in axes.ravel()[len(panels) :]:
        ax.set_axis_off()
    for ax, panel in zip(axes.ravel(), panels, strict=False):
        _panel(ax, [curve for curve in curves if curve.part == panel and curve.points], panel, panel in labelled)
        ax.set_title(titles[panel])
    for ax in axes[:, 0]:
        ax.set_ylabel("relative error (root mean square over taxels)")
    axes[0, 0].figure.suptitle(title)
    save_figure(axes[0, 0].figure, folder, "accuracy")


def _panel(ax: Axes, curves: Sequence[ErrorCurve], panel: str, labelled: bool) -> None:
    from matplotlib.ticker import NullFormatter

    for number, curve in enumerate(curves):
        _draw(ax, curve, number, labelled)
    for number, (label, floor) in enumerate(_floors(curves, panel).items()):
        ax.axhline(floor, color="0.5", linewidth=1, linestyle=("--", "-.", ":")[number % 3], label=label)
    ax.set_xscale("log")
    ax.set_yscale("log")
    _widen(ax)
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("seconds of all processors")
    ax.grid(which="major", alpha=0.4)
    ax.grid(which="minor", alpha=0.12)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=9, frameon=False)


def _floors(curves: Sequence[ErrorCurve], panel: str) -> dict[str, float]:
    """Errors of the reference values, by label, which the panel shows as dashed lines. Many methods share a reference
    of the light."""
    lasts = [(curve.method, curve.points[-1]) for curve in curves]
    if panel == "optics":
        return {f"error of the reference, {last.reference}": last.floor for _, last in lasts if last.floor > 0}
    judged = {method: last.floor for method, last in lasts if last.floor > 0}
    if len(set(judged.values())) == 1:
        return {"error of the reference": next(iter(judged.values()))}
    return {f"error of the reference of {method}": floor for method, floor in judged.items()}


def _draw(ax: Axes, curve: ErrorCurve, number: int, labelled: bool) -> None:
    colour = COLOURS[number % len(COLOURS)]
    marker = MARKERS[(number + number // len(COLOURS)) % len(MARKERS)]
    line = ("-", "--")[number // len(COLOURS) % 2]
    drawn = [point for point in curve.points if point.error > 0]
    ax.plot(
        [point.seconds for point in drawn], [point.error for point in drawn], color=colour, linewidth=1, linestyle=line
    )
    for claimed in (True, False):
        subset = [point for point in drawn if (point.error > point.floor) is claimed]
        ax.plot(
            [point.seconds for point in subset],
            [point.error for point in subset],
            color=colour,
            marker=marker,
            markersize=6,
            markerfacecolor=colour if claimed else "white",
            linestyle="none",
        )
    ax.plot([], [], color=colour, marker=marker, markersize=6, linewidth=1, linestyle=line, label=curve.method)
    if labelled:
        with_stated = [point for point in curve.points if point.stated > 0]
        ax.plot(
            [point.seconds for point in with_stated],
            [point.stated for point in with_stated],
            color=colour,
            linestyle=":",
            linewidth=1.2,
            marker=".",
            label=f"{curve.method}, stated" if with_stated else None,
        )
        for (seconds, error), label in _labels(drawn).items():
            ax.annotate(label, (seconds, error), xytext=(6, 5), textcoords="offset points", fontsize=8)


def _labels(points: Sequence[WorkPoint]) -> dict[tuple[float, float], str]:
    """Labels of points in a panel, by position; points that nearly coincide share one label."""
    labels: dict[tuple[float, float], str] = {}
    for point in points:
        neighbours = [
            position
            for position in labels
            if abs(math.log10(point.seconds / position[0])) < 0.2 and abs(math.log10(point.error / position[1])) < 0.05
        ]
        position = neighbours[0] if neighbours else (point.seconds, point.error)
        labels[position] = f"{labels[position]}, {point.setting}" if neighbours else point.setting
    return labels


def _widen(ax: Axes) -> None:
    """Extend the time axis of a panel to at least one decade."""
    low, high = ax.get_xlim()
    if high < 10 * low:
        middle = math.sqrt(low * high)
        ax.set_xlim(middle / math.sqrt(10), middle * math.sqrt(10))
