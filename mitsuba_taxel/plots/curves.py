"""Plots of power against what a study varies."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import xarray as xr

COLOURS = ("#332288", "#CC6677", "#117733", "#DDAA33", "#88CCEE", "#882255", "#44AA99", "#999933", "#AA4499")
"""After Paul Tol's "muted" scheme, told apart with any colour vision; markers differ too."""
MARKERS = "osD^v<>Px"
MOST_PANELS = 12
PLACES = 200
"""At which curves are drawn."""


def plot_curves(study: xr.Dataset, file: Path | BinaryIO, form: str = "png") -> None:
    """Write a picture (png, svg, pdf) of each taxel's power against the study's curve parameter.

    Bars are 1 sigma of the light, bands the total error. Lines are straight between readings, or where derivatives by
    the parameter are known, the cubic curves that these make of readings without random numbers.
    Where there are several taxels, a second plot below shows how each differs from their mean, with the error
    of that difference. There is one such pair for each combination of the other varied parameters, at most
    :data:`MOST_PANELS`; the title says how many are left out.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    curve = study.attrs["curve"]
    smooth = "derivative" in study and curve in study.parameter.values
    powers = study[["replicate_power", "total_error"]]
    if smooth:
        slope = study.derivative.sel(parameter=curve, drop=True)
        powers = powers.assign(smooth_power=study.smooth_power, slope=slope)
    others = [str(dim) for dim in powers.total_error.dims if dim not in (curve, "taxel")]
    panels = powers.stack(panel=others) if others else powers.expand_dims("panel")
    shown = panels.isel(panel=slice(MOST_PANELS))
    count = shown.sizes["panel"]
    columns = min(math.ceil(math.sqrt(count)), 4)
    lines = 2 if powers.sizes["taxel"] > 1 else 1
    rows = lines * math.ceil(count / columns)
    figure, axes = pyplot.subplots(
        rows,
        columns,
        figsize=(5.2 * columns + 1.2, 3.2 * rows + 0.6),
        sharex=True,
        squeeze=False,
        layout="constrained",
    )
    try:
        for ax in axes.flat:
            ax.set_visible(False)
        for number in range(count):
            panel = shown.isel(panel=number)
            row, column = divmod(number, columns)
            power = panel.replicate_power
            _draw(axes[lines * row, column], power, curve, smooth, panel.total_error)
            if lines > 1:
                _draw(axes[lines * row + 1, column], power - power.mean("taxel"), curve, smooth)
            if smooth:
                _draw_curves(axes[lines * row, column], panel.smooth_power, panel.slope, curve)
                if lines > 1:
                    power, slope = (each - each.mean("taxel") for each in (panel.smooth_power, panel.slope))
                    _draw_curves(axes[lines * row + 1, column], power, slope, curve)
            if others:
                values = (f"{name} = {panel[name].item()}" for name in others)
                axes[lines * row, column].set_title(", ".join(values))
        for row in range(rows):
            axes[row, 0].set_ylabel("difference from the taxels' mean [W]" if row % lines else "optical power [W]")
        figure.supxlabel(_label(study[curve], curve))
        left_out = panels.sizes["panel"] - count
        figure.suptitle(study.attrs["scene"] + (f" ({left_out} more panels left out)" if left_out else ""))
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(
            handles,
            labels,
            title="taxel, row by\nrow from (-x, +y)",
            loc="outside right center",
            frameon=False,
        )
        figure.savefig(file, dpi=150, format=form)
    finally:
        pyplot.close(figure)


def _draw_curves(ax: Any, power: xr.DataArray, slope: xr.DataArray, curve: str) -> None:
    """One line per taxel, through readings and with their slopes."""
    from scipy.interpolate import CubicHermiteSpline

    for number, taxel in enumerate(power.taxel.values):
        value, rate = (each.sel(taxel=taxel).dropna(curve) for each in (power, slope))
        known = value.sortby(curve)
        if known.size > 1:
            places = np.linspace(known[curve].values[0], known[curve].values[-1], PLACES)
            between = CubicHermiteSpline(known[curve].values, known.values, rate.sortby(curve).values)
            ax.plot(places, between(places), linewidth=0.8, **_style(number))


def _style(number: int) -> dict[str, str]:
    """Colour and kind of line of a taxel, from 0."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": ("-", "--", ":")[number // len(COLOURS) % 3],
    }


def _draw(ax: Any, replicates: xr.DataArray, curve: str, bare: bool, total_error: xr.DataArray | None = None) -> None:
    """Each taxel's readings, joined unless ``bare``, with error bars from the replicates, and a band of the total error
    where that is given."""
    values = replicates.mean("replicate")
    errors = replicates.std("replicate", ddof=1) / math.sqrt(replicates.sizes["replicate"])
    for number, taxel in enumerate(replicates.taxel.values):
        ax.errorbar(
            replicates[curve].values,
            values.sel(taxel=taxel).values,
            errors.sel(taxel=taxel).values,
            label=str(taxel),
            marker=MARKERS[number % len(MARKERS)],
            linewidth=0.8,
            **(_style(number) | ({"linestyle": ""} if bare else {})),
            elinewidth=0.8,
            markersize=3,
        )
        if total_error is not None and len(replicates[curve]) > 1:
            middle, width = values.sel(taxel=taxel).values, total_error.sel(taxel=taxel).values
            colour = COLOURS[number % len(COLOURS)]
            ax.fill_between(
                replicates[curve].values, middle - width, middle + width, color=colour, alpha=0.2, linewidth=0
            )
    ax.set_visible(True)
    ax.grid(alpha=0.3)
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))


def _label(coordinate: xr.DataArray, name: str) -> str:
    return f"{name} [{coordinate.attrs['units']}]" if "units" in coordinate.attrs else name
