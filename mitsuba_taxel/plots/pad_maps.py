"""Maps of the readings of many taxels over the sensor: each taxel is a coloured square at its position."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.plots.curves import MOST_TAXELS
from mitsuba_taxel.plots.figures import MOST_PANELS, as_label, panel_axes
from mitsuba_taxel.plots.maps import pair_among

if TYPE_CHECKING:
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

POSITIONS = ("taxel_x", "taxel_y")


def has_pad_map(study: xr.Dataset) -> bool:
    """Whether a study has so many taxels, with positions, that :func:`plot_pad_map` replaces lines.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    bool
        Whether it has.
    """
    return study.sizes["taxel"] > MOST_TAXELS and all(name in study for name in POSITIONS)


def plot_pad_map(study: xr.Dataset, narrow: bool = False) -> Figure:
    """Plot the power of each taxel as the colour of a square at its position, for some scenes of a study.

    All panels have the same scale. At most `MOST_PANELS` scenes are shown, evenly along the study; a cross marks the
    position of the contact if it is varied.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene, with positions of its taxels.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    # The scenes that have readings, and those that are shown.
    dims = [str(dim) for dim in study.power.dims if dim != "taxel"]
    power = study.power.transpose(*dims, "taxel").values
    shape = power.shape[:-1]
    read = np.flatnonzero(np.isfinite(power).any(axis=-1).ravel())
    shown = read[np.unique(np.linspace(0, len(read) - 1, min(len(read), MOST_PANELS)).round().astype(int))]
    contact = pair_among(study, [str(name) for name in study.coords])

    # A panel for each scene, all with the same scale.
    chosen = power.reshape(-1, power.shape[-1])[shown]
    factor, unit = prefixed(float(np.nanmax(chosen, initial=0.0)), "W")
    limits = np.nanmin(chosen) / factor, np.nanmax(chosen) / factor
    across = math.ceil(math.sqrt(len(shown)))
    axes = panel_axes(math.ceil(len(shown) / across), across, size=(2.6, 2.4), narrow=narrow)
    for ax in axes.flat[len(shown) :]:
        ax.set_visible(False)
    for number, (index, values) in enumerate(zip(shown.tolist(), chosen / factor, strict=True)):
        ax = axes.flat[number]
        scene = study.isel(dict(zip(dims, np.unravel_index(index, shape), strict=True)))
        places = np.stack([scene[name].values for name in POSITIONS], axis=1)
        picture = _squares(ax, places, values, limits)
        if contact:
            ax.plot(*(scene[name].values for name in contact), "rx")
        ax.set_title("\n".join(_values_at(scene)), fontsize="small")
        below = number + across >= len(shown) or narrow
        ax.set_xlabel("x [mm]" if below else "")
        ax.set_ylabel("y [mm]" if narrow or not number % across else "")
        ax.tick_params(labelbottom=below)
    figure: Figure = axes.flat[0].figure
    figure.colorbar(picture, ax=axes.ravel().tolist(), label=f"optical power [{unit}]")
    if left_out := len(read) - len(shown):
        figure.suptitle(f"{len(shown)} of {len(read)} scenes; {left_out} are not shown", fontsize="medium")
    return figure


def _squares(ax: Any, places: np.ndarray, values: np.ndarray, limits: tuple[float, float]) -> PolyCollection:
    """Draw squares with colours of ``values`` (T,) at ``places`` (T, 2), as wide as the distance of neighbours."""
    from matplotlib.collections import PolyCollection
    from scipy.spatial import KDTree

    distances, _ = KDTree(places).query(places, k=2)
    half = 0.5 * float(np.min(np.asarray(distances)[:, 1]))
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    # As an image within the vector graphics: thousands of squares would be large.
    squares = PolyCollection(list(places[:, None] + corners), array=values, rasterized=True)
    squares.set(edgecolor="face", linewidth=0.4)  # hides seams between neighbours
    squares.set_clim(*limits)
    ax.add_collection(squares)
    ax.grid(visible=False)
    ax.set_aspect("equal")
    ax.set_xlim(places[:, 0].min() - 2 * half, places[:, 0].max() + 2 * half)
    ax.set_ylim(places[:, 1].min() - 2 * half, places[:, 1].max() + 2 * half)
    return squares


def _values_at(scene: xr.Dataset) -> list[str]:
    """Text with the names and values of the varied parameters of one scene."""
    return [
        f"{name} = {as_label(coordinate.item())} {coordinate.attrs.get('units', '')}".strip()
        for name, coordinate in scene.coords.items()
        if not coordinate.dims
    ]
