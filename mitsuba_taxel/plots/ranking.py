"""Plots of rankings: a row for each variant, the best on top."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise.characteristics import DEVIATIONS
from mitsuba_taxel.characterise.ranking.comparison import WITHIN, Comparison
from mitsuba_taxel.characterise.ranking.ranking_rows import varied_names
from mitsuba_taxel.characterise.wording import as_word
from mitsuba_taxel.plots.figures import COLOURS, panel_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_VARIANTS = 20


def plot_ranking(comparison: Comparison) -> Figure:
    """Plot a ranking of variants: figures of merit with 1 sigma, and each variant's probability of being the best.

    Panels show the figure by which variants are ranked, and figures with a limit. Variants that probably exceed a limit
    are grey.

    Parameters
    ----------
    comparison : Comparison
        Result of :func:`compare`.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    rows = comparison.table.head(MOST_VARIANTS)
    figures = list(dict.fromkeys([comparison.by, *comparison.limits]))
    where = varied_names(comparison)
    labels = [", ".join(f"{name} = {as_word(row[name])}" for name in where) for row in rows.to_dict("records")]
    size = (3.4, 0.32 * len(rows) + 1.0)
    (axes,) = panel_axes(1, len(figures) + 1, size=size, sharex=False)
    colours = [COLOURS[0] if allowed >= WITHIN else "0.6" for allowed in rows.allowed]
    for ax, name in zip(axes, figures, strict=False):
        _draw_figure(ax, rows, name, comparison, colours)
    axes[-1].barh(range(len(rows)), 100 * rows["first"], color=colours)
    axes[-1].set_xlim(0, 100)
    axes[-1].set_xlabel("first [%]")
    for ax in axes:
        ax.set_yticks(range(len(rows)), labels if ax is axes[0] else [""] * len(rows))
        ax.set_ylim(len(rows) - 0.5, -0.5)
    left_out = len(comparison.table) - len(rows)
    words = [comparison.channel, f"{left_out} more variants left out" if left_out else ""]
    axes[0].set_title(", ".join(filter(None, words)), fontsize="medium", loc="left")
    return axes[0].figure


def _draw_figure(ax: Axes, rows: Any, name: str, comparison: Comparison, colours: list[str]) -> None:
    value, error = rows[name].to_numpy(), rows[f"{name}_error"].to_numpy()
    if name not in DEVIATIONS:
        value = np.abs(value)
    limit = comparison.limits.get(name)
    factor, unit = prefixed(float(value.max()), comparison.unit[name])
    for row, colour in enumerate(colours):
        ax.errorbar(value[row] / factor, row, xerr=error[row] / factor, fmt="o", color=colour, markersize=4)
    if limit is not None:
        ax.axvline(limit / factor, color=COLOURS[1], linestyle="--", linewidth=1)
    ax.set_xlabel(f"{name.replace('_', ' ')} [{unit}]" + (", at most the dashed line" if limit is not None else ""))
