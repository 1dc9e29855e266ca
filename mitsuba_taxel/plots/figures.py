"""What all plots share: panels, colours, SI prefixes, force from 0 to the right, and which curves lie in one panel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TypeVar

import numpy as np

from mitsuba_taxel.base.units import FORCES, prefixed

COLOURS = ("#332288", "#CC6677", "#117733", "#DDAA33", "#88CCEE", "#882255", "#44AA99", "#999933", "#AA4499")
"""After Paul Tol's "muted" scheme, told apart with any colour vision; markers differ too."""
MARKERS = "osD^v<>Px"
MOST_LINES = len(COLOURS)
"""Of one panel, where they are compared."""
MOST_PANELS = 12

Case = TypeVar("Case")


class Panel(NamedTuple):
    """Cases that are compared in one panel: what sets it apart from others, in words, and the cases by their names."""

    title: str
    cases: dict[str, Any]


def compared(cases: Sequence[Case], where: Callable[[Case], Mapping[str, Any]]) -> tuple[list[Panel], int]:
    """Panels of cases that differ in parameters, and how many cases find no place.

    All lie in one panel if they are few. Else a panel holds those that differ in one parameter, the one with most
    values that still are few; where there is none, some, evenly chosen, lie in one panel.
    """
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
    panels: dict[str, dict[str, Any]] = {}
    for case in cases:
        title = _words(where(case), [name for name in varied if name != along])
        panels.setdefault(title, {})[_words(where(case), [along])] = case
    chosen = [Panel(title, inside) for title, inside in panels.items()][:MOST_PANELS]
    return chosen, len(cases) - sum(len(panel.cases) for panel in chosen)


def _words(values: Mapping[str, Any], names: Sequence[str]) -> str:
    return ", ".join(f"{name} = {as_label(values[name])}" for name in names if name in values)


def as_label(value: Any) -> str:
    """A parameter's value in a legend."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


@contextmanager
def figure_of(
    rows: int,
    columns: int,
    file: Path | BinaryIO,
    form: str,
    *,
    size: tuple[float, float] = (5.2, 3.2),
    sharex: Any = True,
    sharey: Any = False,
) -> Iterator[Any]:
    """Axes (rows, columns) of ``size`` in inches; the figure is written at the end."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        rows,
        columns,
        figsize=(size[0] * columns + 1.2, size[1] * rows + 0.6),
        sharex=sharex,
        sharey=sharey,
        squeeze=False,
        layout="constrained",
    )
    try:
        for ax in axes.flat:
            ax.grid(alpha=0.3)
        yield axes
        figure.savefig(file, dpi=150, format=form)
    finally:
        pyplot.close(figure)


def label_with_prefix(axes: Iterable[Any], words: str, unit: str) -> None:
    """Label the y axes of panels that share their range, with the SI prefix that their numbers need."""
    shown = list(axes)
    largest = max(abs(end) for ax in shown for end in ax.get_ylim())
    factor, prefix_and_unit = prefixed(largest, unit)
    for ax in shown:
        ax.yaxis.set_major_formatter(lambda value, place: f"{round(value / factor, 9) + 0.0:.7g}".replace("-", "−"))
    shown[0].set_ylabel(f"{words} [{prefix_and_unit}]")


def force_to_the_right(ax: Any, name: str, values: np.ndarray) -> None:
    """Let an axis of forces start at 0 on the left, also where they are negative, as compression is."""
    numbers = np.asarray(values)
    if numbers.dtype.kind in "fi" and any(force in name for force in FORCES) and numbers.max(initial=0) <= 0:
        ax.xaxis.set_inverted(True)


def style(number: int) -> dict[str, str]:
    """Colour, marker and kind of line of the curve with a number, from 0."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[(number + number // len(COLOURS)) % len(MARKERS)],
        "linestyle": ("-", "--", ":")[number // len(COLOURS) % 3],
    }


def legend_beside(figure: Any, ax: Any, title: str | None = None) -> None:
    """The legend of a panel's lines, to the right of all panels."""
    handles, labels = ax.get_legend_handles_labels()
    if any(labels):
        figure.legend(handles, labels, title=title, loc="outside right center", frameon=False)
