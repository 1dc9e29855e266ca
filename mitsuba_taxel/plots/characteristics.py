"""Figures of merit on disk: tables as CSV and LaTeX, and plots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.characteristics import DEVIATIONS, NOT_RESOLVED, SLOPES
from mitsuba_taxel.characterise.equations import from_line
from mitsuba_taxel.characterise.experiment import Branch, Experiment
from mitsuba_taxel.characterise.slopes import relative_slope, slopes
from mitsuba_taxel.characterise.summary import Channel, most_affected
from mitsuba_taxel.characterise.tangential import TangentialMap
from mitsuba_taxel.characterise.wording import by_reading, latex_table, pair_rows, table_rows, with_error
from mitsuba_taxel.plots.figures import (
    FORMS,
    MOST_LINES,
    MOST_PANELS,
    as_label,
    compared,
    label_with_prefix,
    legend_beside,
    load_to_the_right,
    panel_axes,
    save_figure,
    style,
)

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LINES: dict[str, Any] = {"force grows": "-", "force falls": "--", "force grows again": ":"}


def write_characteristics(
    folder: Path,
    experiments: Sequence[Experiment],
    maps: Sequence[TangentialMap],
    table: pandas.DataFrame,
    pairs: pandas.DataFrame,
    volts: pandas.DataFrame | None = None,
) -> list[Path]:
    """Write the figures of merit into a folder.

    Parameters
    ----------
    folder : Path
        Existing folder.
    experiments : sequence of Experiment
        Experiments of a study or a measurement.
    maps : sequence of TangentialMap
        Maps of the same study or measurement.
    table, pairs : pandas.DataFrame
        Result of ``characteristics(experiments)`` and ``symmetric_pairs(maps)``.
    volts : pandas.DataFrame, optional
        Result of ``volts_table``.

    Returns
    -------
    list[Path]
        The files: ``characteristics.csv``, ``volts.csv``, ``characteristics.tex``, ``sensitivity.png`` and, where they
        apply, ``sensitivity_against.png``, ``nonlinearity.png``, ``tangential_map.png`` and ``symmetric_pairs.csv``;
        pictures as SVG too.
    """
    writers: dict[str, Callable[[Path], Any]] = {
        "characteristics.csv": lambda file: table.to_csv(file, index=False),
        "characteristics.tex": lambda file: file.write_text(_latex(table, pairs), encoding="utf-8"),
    }
    if volts is not None:
        writers["volts.csv"] = lambda file: volts.to_csv(file, index=False)
    plots: dict[str, Callable[[], Figure]] = {"sensitivity": partial(plot_sensitivity, experiments)}
    if parameters_of(experiments):
        plots["sensitivity_against"] = partial(plot_against, experiments)
    if len(table[table.figure.isin(DEVIATIONS)]):
        plots["nonlinearity"] = partial(plot_deviations, experiments)
    if maps:
        plots["tangential_map"] = partial(plot_tangential_maps, maps)
        writers["symmetric_pairs.csv"] = lambda file: pairs.to_csv(file, index=False)
    for name, write in writers.items():
        with replacing(folder / name) as temporary:
            write(temporary)
    for name, draw in plots.items():
        save_figure(draw(), folder, name)
    return [folder / name for name in (*writers, *(f"{name}.{form}" for name in plots for form in FORMS))]


def plot_sensitivity(experiments: Sequence[Experiment], narrow: bool = False) -> Figure:
    """Plot change and slope of readings against force, for each experiment's first run of growing force.

    Upper panels show the change of the readings since the start of the experiment, lower panels their slopes, between
    neighbouring points or from derivatives. Panels on the right show both in percent of the reading at rest, if known.
    Error bars are 1 sigma of the light. For one experiment, each line is a taxel. For several experiments, each line is
    an experiment, drawn for the taxel that changes most in all of them.

    Parameters
    ----------
    experiments : sequence of Experiment
        Experiments of a study or a measurement.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    groups = _groups([experiment for experiment in experiments if experiment.loading_runs])
    relative = all(experiment.rest is not None for group in groups for experiment in group.lines.values())
    axes = panel_axes(2 * len(groups), 1 + relative, size=(4.6, 3.0), sharex=False, narrow=narrow)
    for group, (above, below) in zip(groups, axes.reshape(len(groups), 2, -1), strict=True):
        for number, (label, experiment) in enumerate(group.lines.items()):
            _draw_run(above, below, experiment, label, number)
        unit = group.unit
        for row, words, units in ((above, "change", (unit, "%")), (below, "slope", (f"{unit}/N", "%/N"))):
            for ax, axis_unit in zip(row, units, strict=False):
                label_with_prefix([ax], f"{words}{_of(group)}", axis_unit)
        _finish(group, [*above, *below])
        for above_ax, below_ax in zip(above, below, strict=True):
            below_ax.set_xlim(above_ax.get_xlim())
    legend_beside(axes[0, 0].figure, axes[:, 0], groups[0].legend)
    return axes[0, 0].figure


def plot_deviations(experiments: Sequence[Experiment], narrow: bool = False) -> Figure:
    """Plot deviations of branches from the end-point line of the first branch of growing force.

    Deviations are in percent of the largest change, as in equations 5 to 7 of the paper. The solid line is the first
    branch of growing force: its distance from zero is the nonlinearity. The dashed line is the branch of falling force:
    its distance from the solid line is the hysteresis. The dotted line is the second branch of growing force: its
    distance from the solid line is the repeatability. Error bars are 1 sigma of the light. As in
    :func:`plot_sensitivity`, each line is a taxel or, with several experiments, an experiment.

    Parameters
    ----------
    experiments : sequence of Experiment
        Experiments of a study or a measurement.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    groups = _groups(
        [experiment for experiment in experiments if any(branch.loading for branch in experiment.branches)]
    )
    axes = panel_axes(len(groups), 1, size=(6.4, 3.6), sharex=False, narrow=narrow)
    words: dict[str, None] = {}
    for group, (ax,) in zip(groups, axes, strict=True):
        for number, (label, experiment) in enumerate(group.lines.items()):
            cycle = _first_cycle(experiment.branches)
            words |= dict.fromkeys(cycle)
            largest = experiment.largest_change.mean(axis=0)
            for word, branch in cycle.items():
                percent = 100 * from_line(branch, cycle["force grows"]) / np.where(largest > 0, largest, np.nan)
                _draw(ax, branch.force, percent[..., 0], label if word == "force grows" else None, number, LINES[word])
        label_with_prefix([ax], "off the end-point line", "% of $v_{max}$")
        _finish(group, [ax])
    if len(words) > 1:
        _explain_lines(axes[0, 0], words)
    legend_beside(axes[0, 0].figure, axes[:, 0], groups[0].legend)
    return axes[0, 0].figure


def plot_against(experiments: Sequence[Experiment], narrow: bool = False) -> Figure:
    """Plot the mean slope against each varied parameter other than the force.

    Panels show the slopes in the unit of the readings and, if the readings at rest are known, in percent of these. Each
    line belongs to one combination of values of the other parameters, and shows the taxel whose reading changes most
    over all experiments. Error bars are the standard error of the light. Readings in watts and in volts have separate
    panels.

    Parameters
    ----------
    experiments : sequence of Experiment
        Experiments of a study, which differ in at least one parameter of :func:`parameters_of`.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    names, by_unit = parameters_of(experiments), _by_unit(experiments)
    relative = all(experiment.rest is not None for shown in by_unit for experiment in shown)
    axes = panel_axes(len(by_unit) * len(names), 1 + relative, size=(4.6, 3.0), sharex=False, narrow=narrow)
    panels = ((shown, name) for shown in by_unit for name in names)
    for (shown, name), row in zip(panels, axes, strict=True):
        channel = most_affected(shown)
        of = f"readings in {shown[0].unit}" if len(by_unit) > 1 else ""
        title = ", ".join(filter(None, (of, channel.words)))
        lines: dict[str, list[Experiment]] = {}
        for experiment in shown:
            fixed = (
                f"{parameter} = {as_label(experiment.where.get(parameter))}" for parameter in names if parameter != name
            )
            lines.setdefault(", ".join(fixed), []).append(experiment)
        chosen = np.unique(np.linspace(0, len(lines) - 1, MOST_LINES).round().astype(int))
        for number, label in enumerate(np.array(list(lines), dtype=object)[chosen]):
            _draw_against(row, name, lines[label], channel, label, number)
        for ax, unit in zip(row, (f"{shown[0].unit}/N", "%/N"), strict=False):
            label_with_prefix([ax], f"mean slope by {shown[0].force}", unit)
            ax.set_title(title, fontsize="medium")
            ax.set_xlabel(name)
            if len(lines) > 1:
                ax.legend(frameon=False, fontsize="x-small")
        if len(lines) > MOST_LINES:
            row[0].set_title(f"{title} ({len(lines) - MOST_LINES} more lines left out)", fontsize="small")
    return axes[0, 0].figure


def parameters_of(experiments: Sequence[Experiment]) -> list[str]:
    """Parameters in which experiments along one force differ; empty for several forces.

    Parameters
    ----------
    experiments : sequence of Experiment
        Experiments of a study.

    Returns
    -------
    list[str]
        Names.
    """
    loaded = next(iter(_by_unit(experiments)), [])
    if len({(experiment.force, len(experiment.taxel)) for experiment in loaded}) != 1:
        return []
    names = dict.fromkeys(name for experiment in loaded for name in experiment.where)
    return [name for name in names if len({as_label(experiment.where.get(name)) for experiment in loaded}) > 1]


def _by_unit(experiments: Sequence[Experiment]) -> list[list[Experiment]]:
    """Experiments with a run of growing force, grouped by the unit of their readings."""
    by_unit: dict[str, list[Experiment]] = {}
    for experiment in experiments:
        if experiment.loading_runs:
            by_unit.setdefault(experiment.unit, []).append(experiment)
    return list(by_unit.values())


def _draw_against(
    axes: Sequence[Axes], name: str, experiments: list[Experiment], channel: Channel, label: str, number: int
) -> None:
    """Draw mean slopes of experiments, absolute and in percent of rest, against the parameter ``name``."""
    points = []
    for experiment in experiments:
        single = experiment.weighted(channel.weights)
        run = single.loading_runs[0]
        all_ = slopes(run)
        absolute = (all_.mean_slope[0], all_.mean_slope_error[0])
        both = absolute if single.rest is None else (*absolute, *np.ravel(relative_slope(run, all_, single.rest)))
        points.append((experiment.where.get(name), *both))
    numeric = all(isinstance(row[0], (int, float)) for row in points)
    points.sort(key=lambda row: row[0]) if numeric else None
    x, *values = zip(*points, strict=True)
    joined = numeric and name != "step"  # rows of a table may be in any order
    for ax, value, error in zip(axes, values[::2], values[1::2], strict=False):
        look = style(number)
        is_known = np.isfinite(error).all()
        ax.errorbar(
            x if numeric else list(map(str, x)),
            value,
            error if is_known else None,
            label=label or None,
            markersize=4,
            linewidth=0.8,
            **(look if joined else {**look, "linestyle": ""}),
        )


class _Group(NamedTuple):
    """Lines that are drawn in one panel: one channel of each of several experiments."""

    title: str
    lines: dict[str, Experiment]
    force: str
    unit: str
    channel: str
    legend: str | None


def _groups(experiments: Sequence[Experiment]) -> list[_Group]:
    """Groups of experiments, one per panel, up to the largest number of panels.

    A panel compares experiments with the same force, unit and number of taxels.
    """
    comparable: dict[tuple, list[Experiment]] = {}
    for experiment in experiments:
        comparable.setdefault((experiment.force, experiment.unit, len(experiment.taxel)), []).append(experiment)
    groups = []
    for (force, unit, taxels), together in comparable.items():
        channel = most_affected(together)
        panels, left_out = compared(together, lambda experiment: experiment.where)
        for panel in panels:
            lines = {label: experiment.weighted(channel.weights) for label, experiment in panel.cases.items()}
            words, legend = channel.words, None
            if len(together) == 1:
                lines = {
                    str(name): together[0].weighted(row)
                    for name, row in zip(together[0].taxel, np.eye(taxels), strict=True)
                }
                words, legend = "", "taxel"
            more = f"{left_out} more curves left out" if left_out and panel is panels[0] else ""
            groups.append(_Group(", ".join(filter(None, (panel.title, more))), lines, force, unit, words, legend))
    return groups[:MOST_PANELS]


def _of(group: _Group) -> str:
    """Suffix for the label of an axis: the name of the channel that the lines of a group show."""
    return f", {group.channel}" if group.channel else ""


def _finish(group: _Group, axes: Sequence[Axes]) -> None:
    """Add the title and the force axes to the panels of a group."""
    forces = np.concatenate([run.force for experiment in group.lines.values() for run in experiment.runs])
    for ax in axes:
        load_to_the_right(ax, forces)
    axes[0].set_title(group.title, fontsize="medium")
    for ax in axes[-len(axes) // 2 :]:
        ax.set_xlabel(f"{group.force} [N]")


def _draw_run(above: Sequence[Axes], below: Sequence[Axes], experiment: Experiment, label: str, number: int) -> None:
    """Draw change and slope of a channel's first run of growing force, and both in percent of rest."""
    run = experiment.loading_runs[0]
    change = run.samples[..., 0]
    middle, slope = (run.force[1:] + run.force[:-1]) / 2, np.diff(change, axis=0) / np.diff(run.force)[:, None]
    error = None
    if run.tangents is not None:
        middle, slope, error = run.force, run.tangents.slope, run.tangents.error[:, 0]
    _draw(above[0], run.force, change, label, number)
    _draw(below[0], middle, slope, label, number, error=error)
    if experiment.rest is not None and len(above) > 1:
        level = experiment.rest.mean() or np.nan
        shift = (experiment.rest[:, 0] - level) / level
        _draw(above[1], run.force, 100 * (change - change.mean(axis=1, keepdims=True) * shift) / level, label, number)
        residual_slope = slope if error is not None else slope - slope.mean(axis=1, keepdims=True) * shift
        relative = None if error is None else 100 * error / abs(level)
        _draw(below[1], middle, 100 * residual_slope / level, label, number, error=relative)


def plot_tangential_maps(maps: Sequence[TangentialMap], narrow: bool = False) -> Figure:
    """Plot the taxels' changes under each tangential load as maps, x to the right, y upwards.

    Each field shows the taxel's number, its change and 1 sigma; an arrow shows the direction of the load. All maps have
    the same colour scale.

    Parameters
    ----------
    maps : sequence of TangentialMap
        Maps, at least one.
    narrow : bool
        Whether the picture is for a phone.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    count = min(len(maps), MOST_PANELS)
    across = 1 if narrow else min(math.ceil(math.sqrt(count)), 3)
    largest = max(float(np.abs(load_map.change).max()) for load_map in maps[:count])
    factor, unit = prefixed(largest, maps[0].experiment.unit)
    most = largest / factor or 1.0
    axes = panel_axes(math.ceil(count / across), across, size=(5.2, 4.0), sharex=False, narrow=narrow)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    for ax, load_map in zip(axes.flat, maps[:count], strict=False):
        ax.grid(visible=False)
        changes, errors = load_map.change / factor, load_map.error / factor
        picture = ax.imshow(changes, cmap="PuOr", vmin=-most, vmax=most)
        for index, (change, error) in enumerate(zip(changes.flat, errors.flat, strict=True)):
            row, column = divmod(index, load_map.shape[1])
            words = NOT_RESOLVED if abs(change) <= error else with_error(change, error).replace(" ± ", "\n± ")
            ax.text(
                column,
                row,
                f"{load_map.experiment.taxel[index]}\n{words}",
                ha="center",
                va="center",
                color="white" if abs(change) > 0.6 * most else "black",
                fontsize=7,
            )
        _arrow(ax, load_map)
        ax.set_xticks([])
        ax.set_yticks([])
        ax.set_xlabel(f"{load_map.experiment.force} = {load_map.force:.4g} N")
        where = load_map.experiment.where.items()
        ax.set_title(", ".join(f"{name} = {as_label(value)}" for name, value in where), fontsize="medium")
    axes[0, 0].figure.colorbar(picture, ax=axes, label=f"change [{unit}]")
    return axes[0, 0].figure


def _explain_lines(ax: Axes, words: Iterable[str]) -> None:
    """Add a legend that explains line styles, given by their keys in `LINES`."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color="black", linestyle=LINES[word], label=word) for word in words]
    ax.legend(handles=lines, frameon=False, fontsize="small")


def _arrow(ax: Axes, load_map: TangentialMap) -> None:
    """Draw an arrow beside a map, in the direction of the load; rows count downwards, y upwards."""
    push = load_map.direction * np.sign(load_map.force) * (1, -1)
    middle = np.array([load_map.shape[1], load_map.shape[0] / 2 - 0.5])
    ax.annotate("", middle + 0.4 * push, middle - 0.4 * push, arrowprops={"arrowstyle": "-|>", "linewidth": 2})
    ax.set_xlim(-0.5, load_map.shape[1] + 0.5)
    ax.spines[:].set_visible(False)


def _first_cycle(branches: Sequence[Branch]) -> dict[str, Branch]:
    """Branches of the first load cycle, by the key of `LINES`: the first branch of growing force, and the next falling
    and growing branches, if any."""
    start = next(number for number, branch in enumerate(branches) if branch.loading)
    after = [branch for branch in branches[start + 1 :] if branch.side == branches[start].side]
    cycle = {"force grows": branches[start]}
    for branch in after:
        cycle.setdefault("force grows again" if branch.loading else "force falls", branch)
    return cycle


def _draw(
    ax: Axes,
    force: np.ndarray,
    samples: np.ndarray,
    label: str | None,
    number: int,
    line: str = "-",
    error: np.ndarray | None = None,
) -> None:
    """Draw a line of samples (points, replicates) over force, with bars of their scatter, or of ``error`` if given."""
    errors = standard_error(samples, axis=1) if error is None else error
    look = style(number)
    ax.errorbar(
        force,
        samples.mean(axis=1),
        errors if np.isfinite(errors).all() else None,
        label=label,
        markerfacecolor=None if line == "-" else "none",
        linewidth=0.8,
        elinewidth=0.8,
        markersize=3,
        **(look if line == "-" else {**look, "linestyle": line}),
    )


def _latex(table: pandas.DataFrame, pairs: pandas.DataFrame) -> str:
    """LaTeX tables of slopes and deviations for each unit of the readings, and of symmetric pairs; empty tables are
    left out."""
    tables = [
        table_rows(readings, figures, latex=True)
        for figures in (SLOPES, DEVIATIONS)
        for readings in by_reading(table).values()
    ]
    tables.append(pair_rows(pairs, latex=True))
    return "\n".join(latex_table(headings, rows) for headings, rows in tables if rows)
