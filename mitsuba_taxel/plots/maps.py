"""Maps of readings and resolutions over two varied coordinates, such as the position of an indenter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.roles import roles_of_study
from mitsuba_taxel.plots.figures import MOST_PANELS, as_label, panel_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plane_of(study: xr.Dataset) -> tuple[str, str] | None:
    """Find two numeric dimensions of a study that are x and y of one quantity, such as the position of an indenter.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    tuple[str, str] or None
        Names of the parameters along x and y; None if there is no such pair, or if one of them has a single value.
    """
    varied = [
        str(name)
        for name, count in study.sizes.items()
        if count > 1 and name in study and study[name].dtype.kind in "fi"
    ]
    return pair_among(study, varied)


def plane_of_steps(study: xr.Dataset) -> tuple[str, str] | None:
    """Find two parameters that are x and y of one quantity among the columns of a study's load steps.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    tuple[str, str] or None
        Names of the parameters along x and y; None if there is no such pair, or if one of them has a single value in
        all steps.
    """
    listed = [
        str(name)
        for name, coordinate in study.coords.items()
        if coordinate.dims == ("step",) and coordinate.dtype.kind in "fi"
    ]
    return pair_among(study, [name for name in listed if np.ptp(study[name].values) > 0])


def has_map(study: xr.Dataset) -> bool:
    """Whether a study has two coordinates for :func:`plot_map`.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    bool
        Whether it has.
    """
    return bool(plane_of(study) or plane_of_steps(study))


def pair_among(study: xr.Dataset, names: Sequence[str]) -> tuple[str, str] | None:
    """The first two parameters among ``names`` that are x and y of the same position or load; None if there are
    none."""
    roles = roles_of_study(study)
    by_role = {roles[name]: name for name in names if name in roles}
    pairs = ((name, by_role.get(f"{role[:-1]}y")) for role, name in by_role.items() if role.endswith("x"))
    return next(((x_name, y_name) for x_name, y_name in pairs if y_name is not None), None)


def plot_map(study: xr.Dataset, narrow: bool = False) -> Figure:
    """Plot the power of each taxel as a colour map over two varied coordinates; all taxels have the same scale.

    Of more than `MOST_PANELS` taxels, those are shown whose power changes most over the coordinates.

    The coordinates are those of :func:`plane_of`, or else of :func:`plane_of_steps`, whose positions are drawn as dots.
    Other varied parameters have their last values, which the title states. Of several steps at one position, the last
    is shown.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene, with a map.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    listed = None if plane_of(study) else plane_of_steps(study)
    if listed:
        at = np.stack([study[name].values for name in listed], axis=1)
        last = len(at) - 1 - np.unique(at[::-1], axis=0, return_index=True)[1]
        study = study.isel(step=np.sort(last))
    plane = listed or plane_of(study)
    assert plane is not None
    fixed = [str(dim) for dim in study.power.dims if dim not in (*plane, "taxel", *(["step"] if listed else []))]
    shown = study.isel({name: -1 for name in fixed})
    power = shown.power.transpose("taxel", *(["step"] if listed else plane[::-1])).values
    factor, unit = prefixed(float(np.nanmax(power, initial=0.0)), "W")
    axes = _panels(shown, plane, min(len(power), MOST_PANELS), narrow)
    limits = {"vmin": np.nanmin(power) / factor, "vmax": np.nanmax(power) / factor}
    chosen = _most_changed(power, len(axes))
    for ax, taxel, values in zip(axes, study.taxel.values[chosen].tolist(), power[chosen], strict=True):
        x, y = (shown[name].values for name in plane)
        if listed:
            picture = ax.scatter(x, y, c=values / factor, s=40, **limits)
        else:
            picture = ax.pcolormesh(x, y, values / factor, shading="nearest", **limits)
        ax.set_title(f"taxel {taxel}", fontsize="medium")
    figure = axes[0].figure
    figure.colorbar(picture, ax=axes, label=f"optical power [{unit}]")
    count = len(axes)
    left_out = "" if len(power) <= count else f"{len(power) - count} taxels, which change less, are not shown"
    if titles := list(filter(None, (_where(shown, fixed), left_out))):
        figure.suptitle("; ".join(titles), fontsize="medium")
    return figure


def _most_changed(power: np.ndarray, count: int) -> np.ndarray:
    """Indices, ascending, of the ``count`` taxels whose power (T, ...) has the largest range."""
    change = np.ma.ptp(np.ma.masked_invalid(power.reshape(len(power), -1)), axis=1).filled(0.0)
    return np.sort(np.argsort(-change, kind="stable")[:count])


def plot_resolution(resolutions: xr.Dataset, narrow: bool = False) -> Figure:
    """Plot the standard deviation of each unknown, as returned by :func:`resolution`, over two coordinates.

    The coordinates are those of :func:`plane_of`. Each unknown has its own logarithmic scale, with the largest relative
    error in the title; unknown values are white. Other varied parameters have their last values, which the title
    states.

    Parameters
    ----------
    resolutions : xr.Dataset
        Result of :func:`resolution`.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    from matplotlib.colors import LogNorm

    plane = plane_of(resolutions)
    assert plane is not None
    fixed = [str(dim) for dim in resolutions.resolution.dims if dim not in (*plane, "parameter")]
    shown = resolutions.isel({name: -1 for name in fixed})
    axes = _panels(shown, plane, resolutions.sizes["parameter"], narrow)
    for ax, name, unit in zip(
        axes, resolutions.parameter.values.tolist(), resolutions.unit.values.tolist(), strict=True
    ):
        values = shown.resolution.sel(parameter=name).transpose(plane[1], plane[0]).values
        values, unit = (1e-3 * values, "m") if unit == "mm" else (values, unit)
        if not np.isfinite(values).any():
            ax.set_title(f"{name}: not determined by the readings", fontsize="medium")
            continue
        factor, unit = prefixed(float(np.min(values, initial=np.inf, where=np.isfinite(values))), unit)
        values = np.ma.masked_invalid(values / factor)
        picture = ax.pcolormesh(shown[plane[0]], shown[plane[1]], values, shading="nearest", norm=LogNorm())
        scale = ax.figure.colorbar(picture, ax=ax, label=f"1 sigma [{unit}]", shrink=0.8).ax.yaxis
        scale.set_major_formatter("{x:g}")
        scale.set_minor_formatter("{x:g}")
        shares = (shown.resolution_error / shown.resolution).sel(parameter=name).values
        largest = np.max(shares, initial=0.0, where=np.isfinite(shares))
        ax.set_title(f"{name}, ±{100 * largest:.2g} % at most" if largest else name, fontsize="medium")
    if where := _where(shown, fixed):
        axes[0].figure.suptitle(where, fontsize="medium")
    return axes[0].figure


def _panels(shown: xr.Dataset, plane: tuple[str, str], count: int, narrow: bool) -> list[Any]:
    """Axes of maps, without a grid, at the same scale in both directions."""
    across = math.ceil(math.sqrt(count))
    axes = panel_axes(math.ceil(count / across), across, size=(2.6, 2.4), narrow=narrow)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    labels = [" ".join(f"{name} [{shown[name].attrs.get('units', '')}]".replace("[]", "").split()) for name in plane]
    below = 1 if narrow else across
    for number, ax in enumerate(axes.flat[:count]):
        ax.grid(visible=False)
        ax.set_aspect("equal")
        ax.set(xlabel=labels[0], ylabel=labels[1])
        ax.label_outer()
        if number + below >= count:  # this panel is the last in its column
            ax.set_xlabel(labels[0])
            ax.tick_params(labelbottom=True)
    return list(axes.flat[:count])


def _where(shown: xr.Dataset, fixed: list[str]) -> str:
    return ", ".join(f"{name} = {as_label(shown[name].item())}" for name in fixed if name in shown.coords)
