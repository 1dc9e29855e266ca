"""Plots of the comparison with measured sensors: markers are measured values, lines are computed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.pad_comparison import PadComparison, TaxelComparison
from mitsuba_taxel.plots.figures import COLOURS, MARKERS, axes_of, save_small


def mirror(heights: np.ndarray, datasheet: np.ndarray, fine_heights: np.ndarray, curve: np.ndarray, file: Path) -> None:
    """Plot the photocurrent under a mirror against the height, in percent of the largest."""
    ax = axes_of((6, 3.6), 1, 1)[0, 0]
    ax.plot(fine_heights, 100 * curve, color=COLOURS[0], label="computed")
    ax.plot(heights, 100 * datasheet, MARKERS[0], color=COLOURS[1], label="datasheet")
    _finished(ax, "height of the mirror [mm]", "current / largest [%]", file)


def memory(tail: np.ndarray, hold: np.ndarray, file: Path) -> None:
    """Plot the voltage after release, and the force during the hold, at the times and in the time windows of the
    record.

    Parameters
    ----------
    tail : (2, n) ndarray
        Measured and fitted change at n times after release, in percent of the change during the hold.
    hold : (3, m) ndarray
        Measured force, its scatter, and computed force in m time windows, relative to the last window.
    """
    after, during = axes_of((10, 3.6), 1, 2)[0]
    after.loglog(measured.TAIL_TIMES, tail[1], color=COLOURS[0], label="fitted")
    after.loglog(measured.TAIL_TIMES, tail[0], MARKERS[0], color=COLOURS[1], label="measured")
    _labelled(after, "time after release [s]", "change left [%]")
    windows = np.array(measured.HOLD_WINDOWS)
    middle = np.sqrt(windows.prod(axis=1))
    widths = np.abs(windows.T - middle)
    marks: dict[str, Any] = {"linestyle": "none", "capsize": 3}
    during.errorbar(middle, hold[0], hold[1], widths, marker=MARKERS[0], color=COLOURS[1], label="measured", **marks)
    during.plot(middle, hold[2], MARKERS[1], color=COLOURS[0], label="computed")
    during.set_xscale("log")
    _finished(during, "time of the hold [s]", "force / that at the end", file)


def pressed(taxels: Mapping[int, TaxelComparison], file: Path) -> None:
    """Plot force against travel, and the change of the reading against force, for the pressed taxels."""
    force, change = axes_of((10, 4), 1, 2)[0]
    for number, (taxel, compared) in enumerate(taxels.items()):
        colour = COLOURS[number]
        label = f"taxel {taxel}, {'fitted' if taxel == measured.PRESSED else 'predicted'}"
        force.plot(compared.along.travel, compared.along.force, color=colour, label=label)
        force.plot(compared.measured.travel, compared.measured.force, MARKERS[number], color=colour, markersize=5)
        change.plot(compared.along.force, 100 * compared.along.change, color=colour)
        change.plot(
            compared.measured.force, 100 * compared.measured.change, MARKERS[number], color=colour, markersize=5
        )
    _labelled(force, "travel [mm]", "force [N]")
    change.grid(alpha=0.3)
    change.set(xlabel="force [N]", ylabel="change of the voltage [% of that at rest]")
    save_small(change.figure, file)


def maps(results: PadComparison, file: Path) -> None:
    """Plot the changes of all taxels while the middle taxel is held: measured, and computed with the offset of the
    indenter."""
    axes = axes_of((8, 4), 1, 2)[0]
    maps = {"measured": np.array(measured.HELD_MAP), "computed": results.moved}
    for ax, (title, values) in zip(axes, maps.items(), strict=True):
        image = ax.imshow(values, cmap="viridis", vmin=0, vmax=100)
        for (row, column), value in np.ndenumerate(values):
            ax.text(column, row, f"{round(value)}", ha="center", va="center", color="k" if value > 60 else "w")
        ax.set(title=title, xticks=[], yticks=[])
    axes[0].figure.colorbar(image, ax=axes, label="change in % of that of taxel 13", shrink=0.8)
    save_small(axes[0].figure, file)


def sensitivities(ranges: Mapping[str, tuple[tuple[float, float], tuple[float, float]]], file: Path) -> None:
    """Plot the measured and the computed range of sensitivities in V/N of each shape, from the least to the most
    sensitive taxel."""
    ax = axes_of((6, 3.4), 1, 1)[0, 0]
    for side, label in enumerate(("measured", "computed")):
        low, high = 1e3 * np.array([pair[side] for pair in ranges.values()]).T
        position = np.arange(len(ranges)) + (0.1, -0.1)[side]
        colour, marker = COLOURS[1 - side], MARKERS[side]
        ax.vlines(position, low, high, color=colour, linewidth=2)
        ax.plot(np.tile(position, 2), np.concatenate([low, high]), marker, color=colour, label=label)
    ax.set_xticks(range(len(ranges)), list(ranges))
    ax.set_yscale("log")
    _finished(ax, "shape of the cells", "sensitivity [mV/N]", file)


def _labelled(ax: Any, x: str, y: str) -> None:
    ax.grid(alpha=0.3)
    ax.set(xlabel=x, ylabel=y)
    ax.legend(frameon=False)


def _finished(ax: Any, x: str, y: str, file: Path) -> None:
    _labelled(ax, x, y)
    save_small(ax.figure, file)
