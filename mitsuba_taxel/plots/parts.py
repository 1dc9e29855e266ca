"""Drawings of photo-reflectors from above, and their current under a mirror or a white card."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.parts import Part, Side, distance_model
from mitsuba_taxel.plots.figures import COLOURS, panel_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_part(part: Part) -> Figure:
    """Plot a photo-reflector: a plan of its body, windows and dies, and its current against the height of a reflector.

    The reflector is a mirror or a white card, as in the datasheet. Currents are relative to the largest current. Points
    are values of the datasheet.

    Parameters
    ----------
    part : Part
        A photo-reflector.

    Returns
    -------
    Figure
        Matplotlib figure.
    """
    ((above, curve),) = panel_axes(1, 2, sharex=False, size=(5.2, 4.2))
    _draw_from_above(above, part)
    _draw_curve(curve, part)
    return above.figure


def _draw_from_above(ax: Axes, part: Part) -> None:
    from matplotlib.patches import Rectangle

    length, width, _ = part.body
    ax.add_patch(Rectangle((-length / 2, -width / 2), length, width, facecolor="0.35"))
    for side, colour, name in ((part.emitter, COLOURS[1], "emitter"), (part.detector, COLOURS[2], "detector")):
        ax.fill(*_outline(side).T, color=COLOURS[4], label="window" if name == "emitter" else None)
        corner = (side.x - side.die_width / 2, side.y - side.die_length / 2)
        ax.add_patch(Rectangle(corner, side.die_width, side.die_length, facecolor=colour, label=name))
    ax.set_aspect("equal")
    ax.set_xlim(-0.6 * length, 0.6 * length)
    ax.set_ylim(-0.6 * max(length, width), 0.6 * max(length, width))
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_title(part.title, fontsize="medium")
    ax.legend(loc="upper right", fontsize="small")


def _outline(side: Side) -> np.ndarray:
    """Corners (N, 2) of the outline of a window in mm, x and y."""
    if side.window_shape == "rectangle":
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2 * (side.window_width, side.window_length)
    else:
        turn = np.linspace(0, 2 * np.pi, 200)
        half = side.window_width / 2
        ends = (side.window_length / 2 - half) * np.sign(np.sin(turn))
        corners = np.stack([half * np.cos(turn), half * np.sin(turn) + ends], axis=1)
    return corners + side.window_centre


def _draw_curve(ax: Axes, part: Part) -> None:
    datasheet = np.array(part.distance_curve or np.empty((0, 2)))
    heights = np.geomspace(0.1, max(datasheet[:, 0].max(initial=0.0), 3.0), 80)
    power = distance_model(part, heights)
    ax.plot(heights, 100 * power / power.max(), color=COLOURS[0], label=f"these dies, {part.distance_reflector}")
    if len(datasheet):
        ax.plot(*(datasheet * (1, 100)).T, "o", color=COLOURS[1], markersize=4, label="datasheet")
    ax.set_xlabel(f"height of the {part.distance_reflector} above the windows [mm]")
    ax.set_ylabel("current [% of the largest]")
    ax.legend(fontsize="small")
