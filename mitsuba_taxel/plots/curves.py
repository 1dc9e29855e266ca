"""Plots of power, or voltage, against the curve parameter of a study."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import LOADS
from mitsuba_taxel.characterise.roles import is_load, roles_of_study, with_forces_named
from mitsuba_taxel.electronics.volts import circuit_of_study
from mitsuba_taxel.plots.figures import (
    MOST_LINES,
    MOST_PANELS,
    as_label,
    compared,
    label_below,
    label_with_prefix,
    legend_beside,
    load_to_the_right,
    panel_axes,
    style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLACES = 200
"""Number of points of a drawn cubic curve."""
STEP = "step"
TOUCH = ("indenter_x", "indenter_y", "patch_x", "patch_y")
"""Roles of parameters that are positions of a contact."""
TAXELS = "taxel, row by\nrow from (-x, +y)"
MOST_TAXELS = 64
"""Largest number of taxels that are all drawn in one panel."""
QUANTITIES = {"W": "optical power", "V": "voltage"}


class Curve(NamedTuple):
    """Power of the taxels against one parameter, the curve parameter, with all other parameters fixed.

    Attributes
    ----------
    where : Mapping[str, Any]
        Values of the other parameters.
    x : (points,) ndarray
        Values of the curve parameter.
    samples : (points, replicates, taxels) ndarray
        Readings in W.
    error : (points, taxels) ndarray
        Total errors in W.
    smooth, slope : (points, taxels) ndarray or None
        Readings without random numbers, and their derivatives with respect to the curve parameter, if available.
    joined : bool
        Whether the points are joined by a line; points at different positions of a contact are not.
    """

    where: Mapping[str, Any]
    x: np.ndarray
    samples: np.ndarray
    error: np.ndarray
    smooth: np.ndarray | None
    slope: np.ndarray | None
    joined: bool = True

    def weighted(self, weights: np.ndarray) -> Curve:
        """The curve of weighted sums over the taxels, one for each line, with weights (taxels, lines). Errors of taxels
        are taken as fully correlated."""
        smooth, slope = (None if values is None else values @ weights for values in (self.smooth, self.slope))
        return self._replace(
            samples=self.samples @ weights, error=self.error @ np.abs(weights), smooth=smooth, slope=slope
        )

    @property
    def rest(self) -> int:
        """Index of the point with the smallest magnitude of x, or of the first point if x has words as values."""
        return int(np.abs(self.x).argmin()) if self.x.dtype.kind in "fi" else 0

    def relative(self) -> Curve:
        """The curve of the change since rest, in percent of the mean reading at rest; common noise cancels."""
        rest = self.samples[self.rest]
        level = rest.mean(axis=0)
        level = np.where(level > 0, level, np.nan)
        ratio = self.samples.mean(axis=1) / level
        samples = 100 * ((self.samples - ratio[:, None] * rest) / level + ratio[:, None] - 1)
        bare = self._replace(samples=samples, error=0 * self.error)
        if self.smooth is None or self.slope is None:
            return bare
        level = self.smooth[self.rest]
        return bare._replace(smooth=100 * (self.smooth / level - 1), slope=100 * self.slope / level)


def touched_places(study: xr.Dataset) -> tuple[list[str], str]:
    """Parameters that set the contact's position, and those that set the load, in a study whose steps have several
    contact positions.

    Returns
    -------
    names : list[str]
        Parameters of the position that vary; empty if none does.
    load : str
        Parameter of the load that increases at each position; blank if each position has a single load.
    """
    listed = [
        str(name)
        for name, coordinate in study.coords.items()
        if coordinate.dims == (STEP,) and coordinate.dtype.kind in "fi"
    ]
    roles = roles_of_study(study)
    position_names = [name for name in listed if roles.get(name, "") in TOUCH and np.ptp(study[name].values) > 0]
    loads = [name for name in listed if any(roles.get(name) in names for names in LOADS)]
    if not position_names:
        return [], ""
    load = max(loads, key=lambda name: len(np.unique(study[name].values)), default="")
    count = len(np.unique(np.stack([study[name].values for name in position_names], axis=1), axis=0))
    pressed = np.stack([study[name].values for name in (*position_names, *([load] if load else []))], axis=1)
    return position_names, load if len(np.unique(pressed, axis=0)) > count else ""


def curves_of(study: xr.Dataset) -> list[Curve]:
    """Curves of a study, one for each combination of the parameters other than the curve parameter.

    Points are sorted by the curve parameter. In a study whose steps have several loads at several contact positions,
    each position is a curve along the load.
    """
    # Steps with several positions: the curves of each position.
    position_names, load = touched_places(study)
    if load:
        groups = np.unique(np.stack([study[name].values for name in position_names], axis=1), axis=0)
        curves = []
        for point in groups:
            selected = np.all(
                [study[name].values == at for name, at in zip(position_names, point, strict=True)], axis=0
            )
            along = study.isel({STEP: np.flatnonzero(selected)})
            where = dict(zip(position_names, point.tolist(), strict=True))
            one_place = along.drop_vars([name for name in along.coords if along[name].dims == (STEP,)])
            curves += [
                curve._replace(
                    where={**where, **curve.where}, x=along[load].values, smooth=None, slope=None, joined=True
                )
                for curve in curves_of(one_place)
            ]
        return curves

    # Other studies: a curve along the curve's dimension for each combination of the other dimensions.
    name = study.attrs["curve"]
    powers = study[["replicate_power", "total_error"]]
    smooth = "derivative" in study and name in study.parameter.values
    if smooth:
        slope = study.derivative.sel(parameter=name, drop=True)
        powers = powers.assign(smooth_power=study.smooth_power, slope=slope)
    panel_dims = [str(dim) for dim in powers.total_error.dims if dim not in (name, "taxel")]
    panels = powers.stack(panel=panel_dims) if panel_dims else powers.expand_dims("panel")
    panels = panels.transpose("panel", name, "replicate", "taxel")
    x = study[name].values if name in study.coords else np.arange(study.sizes[name])
    if name != STEP and x.dtype.kind in "fi" and len({*np.sign(np.diff(x))}) > 1:
        panels, x = panels.isel({name: np.argsort(x, kind="stable")}), np.sort(x)
    return [
        Curve(
            {dim: panels[dim].values[number].item() for dim in panel_dims},
            x,
            panels.replicate_power.values[number],
            panels.total_error.values[number],
            panels.smooth_power.values[number] if smooth else None,
            panels.slope.values[number] if smooth else None,
            joined=not (name == STEP and position_names),
        )
        for number in range(panels.sizes["panel"])
    ]


def plot_curves(study: xr.Dataset, narrow: bool = False) -> Figure:
    """Plot the readings of a study against its curve parameter: power in W, or voltage with counts on the right.

    Error bars are 1 sigma of the light, bands are the total error. Readings are joined by straight lines or, if they
    have derivatives without random numbers, by cubic curves. Readings at several contact positions with one load each
    are not joined.

    A study with a single curve has a line for each taxel. With several taxels, a second panel shows the difference of
    each taxel from their mean, and the error of this difference. A study with several curves has a line for each curve,
    drawn for the taxel that changes most, and a panel below with the change in percent of the reading at rest. Curves
    at several contact positions are each drawn for the taxel that changes most there; the legend names it. More than
    :data:`mitsuba_taxel.plots.figures.MOST_LINES` lines are distributed over panels with the same axes.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene, in W or V.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    study = with_forces_named(study)
    curves = curves_of(study)
    return _plot_taxels(study, curves[0], narrow) if len(curves) == 1 else _plot_compared(study, curves, narrow)


def _plot_taxels(study: xr.Dataset, curve: Curve, narrow: bool) -> Figure:
    count, chosen = study.sizes["taxel"], _shown_taxels([curve])
    names = study.taxel.values[chosen].tolist()
    axes = panel_axes(2 if count > 1 else 1, 1, narrow=narrow)
    panels = axes[:, 0]
    _draw_lines(panels[0], curve.weighted(np.eye(count)[:, chosen]), names)
    _label(panels[:1], study, _quantity(study))
    if count > 1:
        difference = curve.weighted((np.eye(count) - 1 / count)[:, chosen])
        _draw_lines(panels[1], difference._replace(error=0 * difference.error), names)
        _label(panels[1:], study, "difference from the taxels' mean")
    _finish(axes, study)
    legend_beside(panels[0].figure, panels[:1], _legend_title(count, chosen))
    return panels[0].figure


def _shown_taxels(curves: list[Curve]) -> np.ndarray:
    """Ascending indices of the taxels that are drawn: all taxels or, if there are more than `MOST_TAXELS`, those that
    change most."""
    means = [np.ma.masked_invalid(curve.samples.mean(axis=1)) for curve in curves]
    change = np.max([np.ma.ptp(mean, axis=0).filled(0.0) for mean in means], axis=0)
    if len(change) <= MOST_TAXELS:
        return np.arange(len(change))
    return np.sort(np.argsort(-change, kind="stable")[:MOST_LINES])


def _legend_title(count: int, chosen: np.ndarray) -> str:
    return TAXELS if len(chosen) == count else f"{TAXELS}:\n{len(chosen)} of {count},\nwhich change most"


def _plot_compared(study: xr.Dataset, curves: list[Curve], narrow: bool) -> Figure:
    panels, left_out = compared(curves, lambda curve: curve.where)
    names, lines = study.taxel.values.tolist(), 2 if _changes(curves[0]) else 1
    shown = most_affected(study, curves)
    own = len(set(shown.values())) > 1
    blocks = _blocks(len(panels), lines, narrow)
    for block, panel in zip(blocks, panels, strict=True):
        for number, (label, curve) in enumerate(panel.cases.items()):
            taxel = shown[_key(curve)]
            words = ", ".join(filter(None, (label, f"taxel {names[taxel]}"))) if own else label
            line = curve.weighted(np.eye(len(names))[:, [taxel]])
            _draw_lines(block[0], line, [words], number)
            if lines > 1:
                _draw_lines(block[1], line.relative(), [words], number)
        block[0].set_title(panel.title, fontsize="medium")
    quantity = _quantity(study)
    which = "the taxel that changes most" if own else f"taxel {names[shown[_key(curves[0])]]}, which changes most"
    taxels = f" of {which}" if len(names) > 1 else ""
    _label(blocks[:, 0], study, f"{quantity.split()[-1]}{taxels}" if taxels else quantity)
    if lines > 1:
        label_with_prefix(blocks[:, 1], _since(study, curves[0]), "%")
    _finish(blocks, study, left_out)
    legend_beside(blocks[0, 0].figure, blocks[:, 0])
    return blocks[0, 0].figure


def _key(curve: Curve) -> tuple[tuple[str, Any], ...]:
    """Values of a curve's other parameters, as a key that identifies the curve."""
    return tuple(curve.where.items())


def most_affected(study: xr.Dataset, curves: list[Curve]) -> dict[tuple[tuple[str, Any], ...], int]:
    """Index of the taxel that changes most, for each curve of a study.

    It is the taxel that changes most along the curve if positions of a contact vary, else in all curves.
    """
    means = [np.ma.masked_invalid(curve.samples.mean(axis=1)) for curve in curves]
    change = np.array([np.ma.ptp(mean, axis=0).filled(0.0) for mean in means])
    if not change.any():  # of single points
        change[:] = np.ma.ptp(np.ma.concatenate(means), axis=0).filled(0.0)
    roles = roles_of_study(study)
    touched = any(roles.get(name) in TOUCH for curve in curves for name in curve.where)
    most = change.argmax(axis=1) if touched else np.full(len(curves), change.max(axis=0).argmax())
    return dict(zip(map(_key, curves), most.tolist(), strict=True))


def plot_taxels(study: xr.Dataset, narrow: bool = False) -> Figure:
    """Plot the change of each taxel's reading along each curve of a study, one panel per curve with common axes.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene, in W or V.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    study = with_forces_named(study)
    curves = curves_of(study)
    blocks = _blocks(min(len(curves), MOST_PANELS), 1, narrow)
    chosen = _shown_taxels(curves)
    weights = np.eye(study.sizes["taxel"])[:, chosen]
    for (ax,), curve in zip(blocks, curves, strict=False):
        _draw_lines(ax, curve.weighted(weights).relative(), study.taxel.values[chosen].tolist())
        ax.set_title(", ".join(f"{name} = {as_label(value)}" for name, value in curve.where.items()), fontsize="medium")
    label_with_prefix(blocks[:, 0], _since(study, curves[0]), "%")
    _finish(blocks, study, len(curves) - len(blocks))
    legend_beside(blocks[0, 0].figure, blocks[:, 0], _legend_title(study.sizes["taxel"], chosen))
    return blocks[0, 0].figure


def has_taxels_to_compare(study: xr.Dataset) -> bool:
    """Whether :func:`plot_taxels` shows more than :func:`plot_curves` does.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    bool
        Whether it does.
    """
    curves = curves_of(study)
    return len(curves) > 1 and study.sizes["taxel"] > 1 and _changes(curves[0])


def _unit(study: xr.Dataset) -> str:
    return study.replicate_power.attrs.get("units", "W")


def _quantity(study: xr.Dataset) -> str:
    return QUANTITIES[_unit(study)]


def _label(panels: Any, study: xr.Dataset, words: str) -> None:
    """Label the y axes of panels with readings; for voltages, the counts of the converter are on the right."""
    label_with_prefix(panels, words, _unit(study))
    circuit = circuit_of_study(study)
    if circuit is None or _unit(study) != "V":
        return
    step = circuit.step
    for ax in panels:
        counts = ax.secondary_yaxis("right", functions=(lambda volts: volts / step, lambda counts: counts * step))
    counts.set_ylabel("counts")


def _changes(curve: Curve) -> bool:
    return len(curve.x) > 1 and curve.x.dtype.kind in "fi"


def _since(study: xr.Dataset, curve: Curve) -> str:
    name = touched_places(study)[1] or study.attrs["curve"]
    return f"change since {name} = {curve.x[curve.rest]:.6g}"


def _blocks(count: int, lines: int, narrow: bool) -> Any:
    """Axes (blocks, lines): blocks are side by side, the panels of a block below each other, and rows have a common
    range."""
    across = 1 if narrow else min(math.ceil(math.sqrt(count)), 3)
    down = math.ceil(count / across)
    axes = panel_axes(lines * down, across, narrow=narrow)
    blocks = axes.reshape(down, lines, across).transpose(0, 2, 1).reshape(-1, lines)
    for ax in blocks[count:].flat:
        ax.set_visible(False)
    for line in blocks[:count].T:
        for ax in line[1:]:
            ax.sharey(line[0])
    return blocks[:count]


def _finish(axes: Any, study: xr.Dataset, left_out: int = 0) -> None:
    name = touched_places(study)[1] or study.attrs["curve"]
    coordinate = study[name] if name in study.coords else None
    unit = "" if coordinate is None else coordinate.attrs.get("units", "")
    if coordinate is not None and is_load(study, name):
        load_to_the_right(axes[0, 0], coordinate.values)
    if name == STEP:
        axes[0, 0].xaxis.get_major_locator().set_params(integer=True)
    figure = axes[0, 0].figure
    label_below(figure, axes.flat[-1], f"{name} [{unit}]" if unit else name)
    figure.suptitle(study.attrs["scene"] + (f" ({left_out} more curves left out)" if left_out else ""))


def _draw_lines(ax: Axes, curve: Curve, labels: list[Any], first: int = 0) -> None:
    """Draw the readings of each line, with error bars of the light and bands of the total error, joined by lines or
    cubic curves."""
    replicates = curve.samples.shape[1]
    values = curve.samples.mean(axis=1)
    errors = curve.samples.std(axis=1, ddof=1) / math.sqrt(replicates) if replicates > 1 else 0 * values
    numeric = curve.x.dtype.kind in "fi"
    for number, label in enumerate(labels):
        look = style(first + number)
        ax.errorbar(
            curve.x,
            values[:, number],
            errors[:, number],
            label=str(label),
            linewidth=0.8,
            elinewidth=0.8,
            markersize=3,
            **(look if numeric and curve.joined and curve.smooth is None else {**look, "linestyle": ""}),
        )
        if numeric and curve.joined and curve.error[:, number].any():
            middle, width = values[:, number], curve.error[:, number]
            ax.fill_between(curve.x, middle - width, middle + width, color=look["color"], alpha=0.2, linewidth=0)
        if curve.smooth is not None and curve.slope is not None:
            _draw_cubic(ax, curve.x, curve.smooth[:, number], curve.slope[:, number], look)


def _draw_cubic(ax: Axes, x: np.ndarray, value: np.ndarray, slope: np.ndarray, look: Mapping[str, str]) -> None:
    """Draw the cubic curve through values and slopes at positions x."""
    from scipy.interpolate import CubicHermiteSpline

    finite = np.flatnonzero(np.isfinite(value) & np.isfinite(slope))
    order = finite[np.argsort(x[finite])]
    if len(order) > 1:
        abscissae = np.linspace(x[order[0]], x[order[-1]], PLACES)
        between = CubicHermiteSpline(x[order], value[order], slope[order])
        ax.plot(abscissae, between(abscissae), linewidth=0.8, color=look["color"], linestyle=look["linestyle"])
