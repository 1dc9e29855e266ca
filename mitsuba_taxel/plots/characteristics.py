"""Figures of merit on disk: tables as CSV and LaTeX, and plots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from mitsuba_taxel.base.atomic import replacing
from mitsuba_taxel.characterise.characteristics import DEVIATIONS, SLOPES
from mitsuba_taxel.characterise.equations import from_line
from mitsuba_taxel.characterise.experiment import Branch, Experiment
from mitsuba_taxel.characterise.replicates import standard_error
from mitsuba_taxel.characterise.tangential import TangentialMap
from mitsuba_taxel.characterise.wording import as_word, by_reading, latex_table, pair_rows, table_rows, with_error
from mitsuba_taxel.plots.curves import COLOURS, MARKERS, MOST_PANELS

if TYPE_CHECKING:
    import pandas


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
    table, pairs : pandas.DataFrame
        As ``characteristics(experiments)`` and ``symmetric_pairs(maps)`` return them.
    volts : pandas.DataFrame, optional
        As ``volts_table`` returns it.

    Returns
    -------
    The files: ``characteristics.csv``, ``volts.csv``, ``characteristics.tex``, ``sensitivity.png`` and, where they
    apply, ``nonlinearity.png``, ``tangential_map.png`` and ``symmetric_pairs.csv``; pictures as SVG too.
    """
    writers: dict[str, Callable[[Path], Any]] = {
        "characteristics.csv": lambda file: table.to_csv(file, index=False),
        "characteristics.tex": lambda file: file.write_text(_latex(table, pairs), encoding="utf-8"),
    }
    if volts is not None:
        writers["volts.csv"] = lambda file: volts.to_csv(file, index=False)
    plots: dict[str, Callable[..., None]] = {"sensitivity": partial(plot_sensitivity, experiments)}
    if len(table[table.figure.isin(DEVIATIONS)]):
        plots["nonlinearity"] = partial(plot_deviations, experiments)
    if maps:
        plots["tangential_map"] = partial(plot_tangential_maps, maps)
        writers["symmetric_pairs.csv"] = lambda file: pairs.to_csv(file, index=False)
    for name, draw in plots.items():
        writers.update({f"{name}.{form}": partial(draw, form=form) for form in ("png", "svg")})
    for name, write in writers.items():
        with replacing(folder / name) as temporary:
            write(temporary)
    return [folder / name for name in writers]


def plot_sensitivity(experiments: Sequence[Experiment], file: Path | BinaryIO, form: str = "png") -> None:
    """Write a picture (png, svg, pdf) of each experiment's first run of growing force: change and slope against force.

    Above, how each taxel's reading has changed since the start; below, its slope between neighbouring points. Bars
    are 1 sigma.
    """
    shown = [one for one in experiments if one.loading_runs]
    with _panels(shown, file, form, rows=2) as axes:
        for (above, below), one in zip(axes, shown, strict=False):
            run = one.loading_runs[0]
            _draw(above, run.force, run.value, run.error, one)
            slopes = np.diff(run.samples, axis=0) / np.diff(run.force)[:, None, None]
            middle = (run.force[1:] + run.force[:-1]) / 2
            _draw(below, middle, slopes.mean(axis=1), standard_error(slopes, axis=1), one)
            above.set_ylabel(f"change of the reading [{one.unit}]")
            below.set_ylabel(f"slope [{one.unit}/N]")


def plot_deviations(experiments: Sequence[Experiment], file: Path | BinaryIO, form: str = "png") -> None:
    """Write a picture (png, svg, pdf) of how branches deviate from the end-point line of the first of growing force.

    In percent of the largest change, as equations 5 to 7 have it: the distance from zero is the nonlinearity, that of
    the first falling branch (dashed) from the first growing one (solid) the hysteresis, that of the second growing
    one (dotted) from the first the repeatability. Bars are 1 sigma.
    """
    shown = [one for one in experiments if any(branch.loading for branch in one.branches)]
    with _panels(shown, file, form, rows=1) as axes:
        for (ax,), one in zip(axes, shown, strict=False):
            cycle = _first_cycle(one.branches)
            largest = one.largest_change.mean(axis=0)
            for words, branch in cycle.items():
                percent = 100 * from_line(branch, cycle["force grows"]) / np.where(largest > 0, largest, np.nan)
                _draw(ax, branch.force, percent.mean(axis=1), standard_error(percent, axis=1), one, LINES[words])
            ax.set_ylabel("deviation from the end-point line [% of $v_{max}$]")
            if len(cycle) > 1:
                _explain_lines(ax, cycle)


def plot_tangential_maps(maps: Sequence[TangentialMap], file: Path | BinaryIO, form: str = "png") -> None:
    """Write a picture (png, svg, pdf) of the taxels' changes under each tangential load, x to the right, y upwards.

    Each field holds the taxel's number, its change and 1 sigma; an arrow shows which way the load pushes.
    """
    with _panels([one.experiment for one in maps], file, form, rows=1, sharex=False) as axes:
        for (ax,), one in zip(axes, maps, strict=False):
            power = math.floor(math.log10(np.abs(one.change).max() or 1.0))
            changes, errors = one.change / 10.0**power, one.error / 10.0**power
            most = np.abs(changes).max() or 1.0
            picture = ax.imshow(changes, cmap="PuOr", vmin=-most, vmax=most)
            picture.axes.figure.colorbar(picture, ax=ax, label=f"change [$10^{{{power}}}$ {one.experiment.unit}]")
            for place, (change, error) in enumerate(zip(changes.flat, errors.flat, strict=True)):
                row, column = divmod(place, one.shape[1])
                words = with_error(change, error).replace(" ± ", "\n± ")
                ax.text(
                    column,
                    row,
                    f"{one.experiment.taxel[place]}\n{words}",
                    ha="center",
                    va="center",
                    color="white" if abs(change) > 0.6 * most else "black",
                    fontsize=7,
                )
            _arrow(ax, one)
            ax.set_xticks([])
            ax.set_yticks([])
            ax.set_xlabel(f"{one.experiment.force} = {one.force:.4g} N")


def _explain_lines(ax: Any, words: Iterable[str]) -> None:
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color="black", linestyle=LINES[word], label=word) for word in words]
    ax.legend(handles=lines, frameon=False, fontsize="small")


def _arrow(ax: Any, one: TangentialMap) -> None:
    """The direction of the push, on a strip beside the map; rows count downwards, y upwards."""
    push = one.direction * np.sign(one.force) * (1, -1)
    middle = np.array([one.shape[1], one.shape[0] / 2 - 0.5])
    ax.annotate("", middle + 0.4 * push, middle - 0.4 * push, arrowprops={"arrowstyle": "-|>", "linewidth": 2})
    ax.set_xlim(-0.5, one.shape[1] + 0.5)
    ax.spines[:].set_visible(False)


def _first_cycle(branches: Sequence[Branch]) -> dict[str, Branch]:
    """By what the force does: its first growing branch, and the next falling and growing ones if there are any."""
    start = next(number for number, branch in enumerate(branches) if branch.loading)
    after = [branch for branch in branches[start + 1 :] if branch.side == branches[start].side]
    cycle = {"force grows": branches[start]}
    for branch in after:
        cycle.setdefault("force grows again" if branch.loading else "force falls", branch)
    return cycle


@contextmanager
def _panels(
    experiments: Sequence[Experiment], file: Path | BinaryIO, form: str, rows: int, sharex: bool = True
) -> Iterator[np.ndarray]:
    """Axes (panels, rows), a panel per experiment, its plots above each other; the figure is written at the end."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    count = min(len(experiments), MOST_PANELS)
    across = min(math.ceil(math.sqrt(count)), 4)
    down = math.ceil(count / across)
    size = (5.2 * across + 1.2, 3.4 * rows * down + 0.6)
    figure, grid = pyplot.subplots(rows * down, across, figsize=size, squeeze=False, layout="constrained")
    try:
        axes = grid.reshape(down, rows, across).transpose(0, 2, 1).reshape(-1, rows)
        for ax in axes[count:].flat:
            ax.set_visible(False)
        yield axes[:count]
        for column, one in zip(axes[:count], experiments, strict=False):
            column[0].set_title(
                ", ".join(f"{name} = {as_word(value)}" for name, value in one.where.items()), fontsize="medium"
            )
            if sharex:
                column[-1].set_xlabel(f"{one.force} [N]")
        if len(experiments) > count:
            figure.suptitle(f"{len(experiments) - count} more panels left out")
        handles, labels = max((ax.get_legend_handles_labels() for ax in axes[:count, 0]), key=lambda pair: len(pair[1]))
        if labels:
            figure.legend(handles, labels, title="taxel", loc="outside right center", frameon=False)
        figure.savefig(file, dpi=150, format=form)
    finally:
        pyplot.close(figure)


def _draw(
    ax: Any, force: np.ndarray, values: np.ndarray, errors: np.ndarray, experiment: Experiment, style: str = "-"
) -> None:
    """One line per taxel over force, with error bars where errors are known; only solid ones enter the legend."""
    for number, taxel in enumerate(experiment.taxel):
        known = np.isfinite(errors[:, number]).all()
        ax.errorbar(
            force,
            values[:, number],
            errors[:, number] if known else None,
            label=str(taxel) if style == "-" else None,
            color=COLOURS[number % len(COLOURS)],
            marker=MARKERS[(number + number // len(COLOURS)) % len(MARKERS)],
            markerfacecolor=None if style == "-" else "none",
            linestyle=style,
            linewidth=0.8,
            elinewidth=0.8,
            markersize=3,
        )
    ax.grid(alpha=0.3)
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))


def _latex(table: pandas.DataFrame, pairs: pandas.DataFrame) -> str:
    parts = list(by_reading(table).values())
    tables = [table_rows(part, figures, latex=True) for figures in (SLOPES, DEVIATIONS) for part in parts]
    return "\n".join(latex_table(*parts) for parts in (*tables, pair_rows(pairs, latex=True)) if parts[1])
