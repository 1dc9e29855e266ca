"""Maps of readings over two places that are varied, such as those of an indenter."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.plots.figures import MOST_PANELS, as_label, panel_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plane_of(study: xr.Dataset) -> tuple[str, str] | None:
    """Two parameters that a study varies over numbers, of names that end in x and y but for that are one; None if it
    has no such pair, or one of them has a single value."""
    varied = [
        str(name)
        for name, count in study.sizes.items()
        if count > 1 and name in study and study[name].dtype.kind in "fi"
    ]
    pairs = [(name, f"{name[:-1]}y") for name in varied if name.endswith("x")]
    return next((pair for pair in pairs if pair[1] in varied), None)


def plot_map(study: xr.Dataset, narrow: bool = False) -> Figure:
    """Power of each taxel, as a colour over the two parameters of :func:`plane_of`; all taxels have one scale.

    Of other parameters that are varied the last values are taken, which the title tells.
    """
    plane = plane_of(study)
    assert plane is not None
    others = [str(dim) for dim in study.power.dims if dim not in (*plane, "taxel")]
    shown = study.isel({name: -1 for name in others})
    power = shown.power.transpose("taxel", plane[1], plane[0]).values
    factor, unit = prefixed(float(np.nanmax(power, initial=0.0)), "W")
    count = min(len(power), MOST_PANELS)
    across = math.ceil(math.sqrt(count))
    axes = panel_axes(math.ceil(count / across), across, size=(2.6, 2.4), narrow=narrow)
    limits = {"vmin": np.nanmin(power) / factor, "vmax": np.nanmax(power) / factor}
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    for ax, taxel, values in zip(axes.flat, study.taxel.values.tolist(), power, strict=False):
        ax.grid(visible=False)
        ax.set_aspect("equal")
        picture = ax.pcolormesh(shown[plane[0]], shown[plane[1]], values / factor, shading="nearest", **limits)
        ax.set_title(f"taxel {taxel}", fontsize="medium")
    labels = [" ".join(f"{name} [{study[name].attrs.get('units', '')}]".replace("[]", "").split()) for name in plane]
    for ax in axes.flat[:count]:
        ax.set(xlabel=labels[0], ylabel=labels[1])
        ax.label_outer()
    figure = axes[0, 0].figure
    figure.colorbar(picture, ax=axes, label=f"optical power [{unit}]")
    where = ", ".join(f"{name} = {as_label(shown[name].item())}" for name in others if name in shown.coords)
    if where or len(power) > count:
        left_out = "" if len(power) <= count else f"{len(power) - count} taxels are not shown"
        figure.suptitle("; ".join(filter(None, (where, left_out))), fontsize="medium")
    return figure
