"""Work-precision diagrams: error against seconds, one panel for each part of the computation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_taxel.plots.figures import COLOURS, MARKERS, axes_of, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, Point

TITLES = {"optics": "light", "mechanics": "mechanics", "chain": "reading: light and mechanics"}
MOST_ACROSS = 4
LABELLED = ("mechanics", "chain")
"""Parts with few points, which are labelled."""


def plot_accuracy(
    curves: Sequence[ErrorCurve],
    title: str,
    folder: Path,
    titles: Mapping[str, str] = TITLES,
    labelled: Sequence[str] = LABELLED,
) -> None:
    """Write the diagram as ``accuracy.png`` and ``accuracy.svg``, a panel for each of the parts that have ``titles``.

    Filled markers are significant errors, hollow ones lie below the error of the reference, a dashed line. Dotted lines
    are errors stated by the method, for parts with few methods, which are ``labelled``.
    """
    parts = [part for part in titles if any(curve.part == part and curve.points for curve in curves)]
    across = min(len(parts), MOST_ACROSS)
    down = math.ceil(len(parts) / across)
    axes = axes_of((6.4 * across, 7.2 * down), down, across)
    for ax in axes.ravel()[len(parts) :]:
        ax.set_axis_off()
    for ax, part in zip(axes.ravel(), parts, strict=False):
        _panel(ax, [curve for curve in curves if curve.part == part and curve.points], part, part in labelled)
        ax.set_title(titles[part])
    for ax in axes[:, 0]:
        ax.set_ylabel("relative error (root mean square over taxels)")
    axes[0, 0].figure.suptitle(title)
    save_figure(axes[0, 0].figure, folder, "accuracy")


def _panel(ax: Axes, curves: Sequence[ErrorCurve], part: str, labelled: bool) -> None:
    from matplotlib.ticker import NullFormatter

    for number, curve in enumerate(curves):
        _draw(ax, curve, number, labelled)
    for number, (label, floor) in enumerate(_floors(curves, part).items()):
        ax.axhline(floor, color="0.5", linewidth=1, linestyle=("--", "-.", ":")[number % 3], label=label)
    ax.set_xscale("log")
    ax.set_yscale("log")
    _widen(ax)
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("seconds of all processors")
    ax.grid(which="major", alpha=0.4)
    ax.grid(which="minor", alpha=0.12)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=9, frameon=False)


def _floors(curves: Sequence[ErrorCurve], part: str) -> dict[str, float]:
    """Errors of the references by label: those of the light are shared by many methods."""
    lasts = [(curve.method, curve.points[-1]) for curve in curves]
    if part == "optics":
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
        chosen = [point for point in drawn if (point.error > point.floor) is claimed]
        ax.plot(
            [point.seconds for point in chosen],
            [point.error for point in chosen],
            color=colour,
            marker=marker,
            markersize=6,
            markerfacecolor=colour if claimed else "white",
            linestyle="none",
        )
    ax.plot([], [], color=colour, marker=marker, markersize=6, linewidth=1, linestyle=line, label=curve.method)
    if labelled:
        stated = [point for point in curve.points if point.stated > 0]
        ax.plot(
            [point.seconds for point in stated],
            [point.stated for point in stated],
            color=colour,
            linestyle=":",
            linewidth=1.2,
            marker=".",
            label=f"{curve.method}, stated" if stated else None,
        )
        for (seconds, error), label in _labels(drawn).items():
            ax.annotate(label, (seconds, error), xytext=(6, 5), textcoords="offset points", fontsize=8)


def _labels(points: Sequence[Point]) -> dict[tuple[float, float], str]:
    """Labels by position; one label for points that nearly coincide."""
    labels: dict[tuple[float, float], str] = {}
    for point in points:
        near = [
            place
            for place in labels
            if abs(math.log10(point.seconds / place[0])) < 0.2 and abs(math.log10(point.error / place[1])) < 0.05
        ]
        place = near[0] if near else (point.seconds, point.error)
        labels[place] = f"{labels[place]}, {point.setting}" if near else point.setting
    return labels


def _widen(ax: Axes) -> None:
    """Widen the axis of seconds to at least a decade."""
    low, high = ax.get_xlim()
    if high < 10 * low:
        middle = math.sqrt(low * high)
        ax.set_xlim(middle / math.sqrt(10), middle * math.sqrt(10))
