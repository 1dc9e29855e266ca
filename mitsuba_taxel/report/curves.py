"""Plots of power against what a study varies."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import xarray as xr

COLOURS = ("#332288", "#CC6677", "#117733", "#DDAA33", "#88CCEE", "#882255", "#44AA99", "#999933", "#AA4499")
"""After Paul Tol's "muted" scheme, told apart with any colour vision; markers differ too."""
MARKERS = "osD^v<>Px"
MOST_PANELS = 12


def plot_curves(study: xr.Dataset, file: Path) -> None:
    """Write a PNG of each taxel's power with error bars (1 sigma) against the study's curve parameter.

    One panel for each combination of the other varied parameters, at most :data:`MOST_PANELS`; the title says
    how many there are if not all are shown.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    curve = study.attrs["curve"]
    others = [str(dim) for dim in study.power.dims if dim not in (curve, "taxel")]
    stacked = (
        study[["power", "standard_error"]].stack(panel=others) if others else study.expand_dims(panel=[0])
    )
    shown = stacked.isel(panel=slice(MOST_PANELS))
    columns = min(math.ceil(math.sqrt(shown.sizes["panel"])), 4)
    rows = math.ceil(shown.sizes["panel"] / columns)
    figure, axes = pyplot.subplots(
        rows, columns, figsize=(5.2 * columns + 1.2, 3.8 * rows), sharex=True, sharey=True, squeeze=False,
        layout="constrained",
    )  # fmt: skip
    try:
        for panel, ax in zip(range(shown.sizes["panel"]), axes.flat, strict=False):
            _draw_panel(ax, shown.isel(panel=panel), curve)
            if others:
                values = (shown[name].values[panel] for name in others)
                ax.set_title(
                    ", ".join(f"{name} = {value}" for name, value in zip(others, values, strict=True))
                )
        for ax in axes.flat[shown.sizes["panel"] :]:
            ax.set_visible(False)
        figure.supxlabel(_label(study[curve], curve))
        figure.supylabel("optical power [W]")
        hidden = stacked.sizes["panel"] - shown.sizes["panel"]
        figure.suptitle(study.attrs["scene"] + (f" ({hidden} more panels not shown)" if hidden else ""))
        handles, labels = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, title="taxel", loc="outside right center", frameon=False)
        figure.savefig(file, dpi=150, format="png")
    finally:
        pyplot.close(figure)


def _draw_panel(ax: Any, panel: xr.Dataset, curve: str) -> None:
    for number, taxel in enumerate(panel.taxel.values):
        readings = panel.sel(taxel=taxel)
        ax.errorbar(
            panel[curve].values, readings.power.values, readings.standard_error.values, label=str(taxel),
            color=COLOURS[number % len(COLOURS)], marker=MARKERS[number % len(MARKERS)],
            linestyle=("-", "--", ":")[number // len(COLOURS) % 3], linewidth=1, markersize=3.5, capsize=2,
        )  # fmt: skip
    ax.grid(alpha=0.3)
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))


def _label(coordinate: xr.DataArray, name: str) -> str:
    return f"{name} [{coordinate.attrs['units']}]" if "units" in coordinate.attrs else name
