"""Common to all plots: panels, colours, SI prefixes, force axes, and the distribution of curves over panels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.base.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMS = ("png", "svg")
COLOURS = ("#332288", "#CC6677", "#117733", "#DDAA33", "#88CCEE", "#882255", "#44AA99", "#999933", "#AA4499")
"""Paul Tol's "muted" scheme, distinguishable with any colour vision; markers differ too."""
MARKERS = "osD^v<>Px"
MOST_LINES = len(COLOURS)
"""Largest number of lines in one panel."""
MOST_PANELS = 12
NARROW = 4.2
"""Width in inches of a figure for a phone: text of 10 points then matches its surroundings."""

Case = TypeVar("Case")


@dataclass(frozen=True)
class Panel(Generic[Case]):
    """One panel of a figure: its title, and the curves or other cases that are compared in it, by name."""

    title: str
    cases: dict[str, Case]


def compared(cases: Sequence[Case], where: Callable[[Case], Mapping[str, object]]) -> tuple[list[Panel[Case]], int]:
    """Distribute cases, such as the curves of a study, over the panels of a figure.

    A few cases share one panel. Many cases are grouped such that the cases of a panel differ in one parameter only: the
    parameter with the largest number of values that still fit into a panel. If the values of no parameter fit, a single
    panel has an even selection of the cases.

    Parameters
    ----------
    cases : Sequence[Case]
        Cases to be compared.
    where : Callable[[Case], Mapping[str, object]]
        Function that returns the parameters of a case.

    Returns
    -------
    panels : list[Panel[Case]]
        Panels, at most `MOST_PANELS`.
    left_out : int
        Number of cases that are in no panel.
    """
    # The varied parameters, and the parameter that is compared within panels.
    values: dict[str, dict[str, None]] = {}
    for case in cases:
        for name, value in where(case).items():
            values.setdefault(name, {})[as_label(value)] = None
    varied = [name for name, words in values.items() if len(words) > 1]
    few = [name for name in varied if len(values[name]) <= MOST_LINES]
    along = max(few, key=lambda name: len(values[name]), default=None)
    if len(cases) <= MOST_LINES or along is None:
        shown = np.unique(np.linspace(0, len(cases) - 1, min(len(cases), MOST_LINES)).round().astype(int))
        panel = Panel("", {_words(where(cases[n]), varied): cases[n] for n in shown.tolist()})
        return [panel], len(cases) - len(panel.cases)

    # Cases by the values of the other parameters.
    panels: dict[str, dict[str, Case]] = {}
    for case in cases:
        title = _words(where(case), [name for name in varied if name != along])
        panels.setdefault(title, {})[_words(where(case), [along])] = case
    chosen = [Panel(title, inside) for title, inside in panels.items()][:MOST_PANELS]
    return chosen, len(cases) - sum(len(panel.cases) for panel in chosen)


def _words(values: Mapping[str, object], names: Sequence[str]) -> str:
    return ", ".join(f"{name} = {as_label(values[name])}" for name in names if name in values)


def as_label(value: object) -> str:
    """Format the value of a parameter for a legend."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def axes_of(inches: tuple[float, float], rows: int, columns: int, **options: Any) -> Any:
    """Create a figure without a window, and return its axes.

    Parameters
    ----------
    inches : tuple[float, float]
        Width and height of the figure.
    rows, columns : int
        Rows and columns of axes.
    **options : Any
        Options of matplotlib's ``subplots``.

    Returns
    -------
    (rows, columns) ndarray of Axes
        Axes of matplotlib.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=inches, dpi=150, layout="constrained").subplots(rows, columns, squeeze=False, **options)


def panel_axes(
    rows: int, columns: int, *, size: tuple[float, float] = (5.2, 3.2), sharex: Any = True, narrow: bool = False
) -> Any:
    """Create a figure for panels, and return its axes, with a grid.

    Parameters
    ----------
    rows, columns : int
        Rows and columns of axes.
    size : tuple[float, float]
        Width and height of a panel in inches.
    sharex : bool or str
        Option of matplotlib's ``subplots``.
    narrow : bool
        Whether the figure is for a phone: all panels are in one column, with the legend below.

    Returns
    -------
    ndarray of Axes
        (rows, columns), or (rows * columns, 1) of a narrow figure.
    """
    inches = (size[0] * columns + 1.2, size[1] * rows + 0.6)
    shape = (rows, columns)
    if narrow:
        shape, inches = (rows * columns, 1), (NARROW, 2.6 * rows * columns + 1.2)
    axes = axes_of(inches, *shape, sharex=sharex)
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    return axes.reshape(rows, columns)


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Write a figure as PNG and as SVG, laid out once.

    Parameters
    ----------
    figure : Figure
        Matplotlib figure.
    folder : Path
        Existing folder.
    name : str
        Name of the files, without ending.

    Raises
    ------
    WriteError
        if a file cannot be written.
    """
    for form in FORMS:
        with replacing(folder / f"{name}.{form}") as file:
            figure.savefig(file, format=form)
        figure.set_layout_engine(None)  # "none" would still draw once more to lay it out


def save_small(figure: Figure, file: Path) -> None:
    """Write a figure as PNG with 256 colours, a third of the usual size, for pages under version control.

    Parameters
    ----------
    figure : Figure
        Matplotlib figure.
    file : Path
        PNG file.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    from PIL import Image

    full = BytesIO()
    figure.savefig(full, format="png")
    with replacing(file) as new:
        Image.open(full).convert("RGB").quantize(dither=Image.Dither.NONE).save(new, "png", optimize=True)


def label_with_prefix(axes: Iterable[Axes], words: str, unit: str) -> None:
    """Label the y axes of panels that share their range, with the SI prefix that their numbers need.

    Parameters
    ----------
    axes : iterable of Axes
        Axes of the panels; the first gets the label.
    words : str
        Description of the plot's content.
    unit : str
        Unit without prefix.
    """
    shown = list(axes)
    largest = max(abs(end) for ax in shown for end in ax.get_ylim())
    factor, prefix_and_unit = prefixed(largest, unit)
    for ax in shown:
        ax.yaxis.set_major_formatter(lambda value, _position: f"{round(value / factor, 9) + 0.0:.7g}".replace("-", "−"))
    shown[0].set_ylabel(f"{words} [{prefix_and_unit}]")


def label_below(figure: Figure, last: Axes, words: str) -> None:
    """Label the common x axis of all panels: below the whole figure, or below the last panel if they are in one
    column."""
    if figure.get_figwidth() > NARROW:
        figure.supxlabel(words)
    else:
        last.set_xlabel(words)


def load_to_the_right(ax: Axes, values: np.ndarray) -> None:
    """Let an axis of loads start at 0 on the left, also for negative loads, such as compression."""
    numbers = np.asarray(values)
    if numbers.dtype.kind in "fi" and numbers.max(initial=0) <= 0:
        ax.xaxis.set_inverted(True)


def style(number: int) -> dict[str, Any]:
    """Colour, marker and line style of a curve by its number, from 0.

    Parameters
    ----------
    number : int
        Number of the curve.

    Returns
    -------
    dict[str, Any]
        Options of matplotlib's ``plot``.
    """
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[(number + number // len(COLOURS)) % len(MARKERS)],
        "linestyle": ("-", "--", ":")[number // len(COLOURS) % 3],
    }


def legend_beside(figure: Figure, axes: Sequence[Axes], title: str | None = None) -> None:
    """Draw the common legend of all panels to their right; in a narrow figure, below the panels.

    A narrow figure that is longer than a screen has the legend in each panel.

    Parameters
    ----------
    figure : Figure
        Matplotlib figure.
    axes : sequence of Axes
        Axes of the panels, which show the same lines.
    title : str, optional
        Title of the legend.
    """
    handles, labels = axes[0].get_legend_handles_labels()
    if not any(labels):
        return
    if figure.get_figwidth() > NARROW:
        figure.legend(handles, labels, title=title, loc="outside right center", frameon=False)
    elif len(axes) > 2:
        for ax in axes:
            ax.legend(fontsize="x-small", framealpha=0.6, ncols=1 + len(labels) // 5)
    else:
        columns = max(1, min(5, 40 // (max(map(len, labels)) + 5)))
        figure.legend(handles, labels, title=title, loc="outside lower center", frameon=False, ncols=columns)
