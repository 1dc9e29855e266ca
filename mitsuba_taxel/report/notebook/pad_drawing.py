"""Drawings of pads, section and plan with dimensions in mm, as SVG in the surrounding text colour."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape

import numpy as np

from mitsuba_taxel.pads.parametric.pad import Pad

WIDTH, GAP, TOP, TEXT = 300.0, 70.0, 12.0, 11
"""Width of a view, margins at its sides and above it, and height of text, in pixels."""
MOST_NUMBERS = 100
"""Largest number of cells that are numbered."""
SILICONE = 'fill="#6f8ba6" fill-opacity="0.35" stroke="currentColor" stroke-width="1.2" fill-rule="evenodd"'
_TICK, _FIRST, _SECOND = 4.0, 16.0, 40.0
"""Half length of a tick, and distances of rows of dimensions from the outline, in pixels."""

Point = tuple[float, float]


def draw_pad(pad: Pad) -> str:
    """SVG drawing of a pad: section through the middle row of cells, and plan with the numbers of the cells."""
    length, depth, height = pad.extent
    scale = WIDTH / max(length, depth)
    words = f"Section and plan of a pad of {length:g} by {depth:g} by {height:g} mm with {pad.cell} cells"
    centres = sorted({x for x, _ in pad.cell_centres})
    section = _PlaneView((-0.5 * length, 0.0), height, scale, TOP)
    elements = [f'<path d="{_section_path(pad, centres, section)}" {SILICONE}/>']
    radius, first = 0.5 * pad.cell_size, centres[0]
    edges = [-0.5 * length, first - radius, first + radius]
    elements += [section.below(edges[k], edges[k + 1], 0.0, _FIRST) for k in (0, 1)]
    if len(centres) > 1:
        elements.append(section.below(centres[-2], centres[-1], 0.0, _FIRST))
    elements.append(section.below(-0.5 * length, 0.5 * length, 0.0, _SECOND))
    elements.append(section.beside(0.0, height, 0.5 * length, _FIRST))
    elements.append(section.beside(0.0, pad.top_of_cell, -0.5 * length, -_FIRST))
    plan = _PlaneView((-0.5 * length, -0.5 * depth), depth, scale, TOP + scale * height + 2 * _SECOND)
    elements.append(f'<path d="{_plan_path(pad, plan)}" {SILICONE}/>')
    if len(pad.cell_centres) <= MOST_NUMBERS:
        elements += [plan.label(centre, str(number)) for number, centre in enumerate(pad.cell_centres, start=1)]
    elements.append(plan.beside(-0.5 * depth, 0.5 * depth, 0.5 * length, _FIRST))
    return _svg(words, scale * length + 2 * GAP, plan.bottom + TOP, elements)


def draw_surface(vertices: np.ndarray, triangles: np.ndarray) -> str:
    """SVG drawing of two sections of a closed surface with vertices (V, 3) in mm and triangles (T, 3).

    The vertical section is through the middle; the horizontal section is just above the bottom, where cells are open.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = high - low
    scale = WIDTH / max(size[:2])
    words = f"Section and plan of a pad of {size[0]:.4g} by {size[1]:.4g} by {size[2]:.4g} mm"
    upright = _segments(vertices, triangles, 1, low[1] + 0.5001 * size[1])
    flat = _segments(vertices, triangles, 2, low[2] + 0.01 * size[2])
    section = _PlaneView((low[0], low[2]), size[2], scale, TOP)
    plan = _PlaneView((low[0], low[1]), size[1], scale, TOP + scale * size[2] + 2 * _SECOND)
    elements = [section.lines(upright[:, :, [0, 2]]), plan.lines(flat[:, :, [0, 1]])]
    elements.append(section.below(low[0], high[0], low[2], _FIRST))
    elements.append(section.beside(low[2], high[2], high[0], _FIRST))
    elements.append(plan.beside(low[1], high[1], high[0], _FIRST))
    return _svg(words, scale * size[0] + 2 * GAP, plan.bottom + TOP, elements)


class _PlaneView:
    """Map of a plane of the pad to the drawing, from mm to pixels, with the second coordinate upwards.

    Parameters
    ----------
    corner : Point
        Lowest coordinates of the view, in mm.
    height : float
        Height of the view, in mm.
    scale : float
        Pixels per mm.
    top : float
        Distance from the upper edge of the drawing, in pixels.
    """

    def __init__(self, corner: Point, height: float, scale: float, top: float) -> None:
        self.corner, self.scale = corner, scale
        self.bottom = top + scale * height

    def at(self, x: float, y: float) -> Point:
        return GAP + self.scale * (x - self.corner[0]), self.bottom - self.scale * (y - self.corner[1])

    def below(self, start: float, end: float, y: float, distance: float) -> str:
        """SVG elements of a dimension line along the first coordinate, ``distance`` pixels below height ``y``."""
        (a, line), (b, _) = self.at(start, y), self.at(end, y)
        line += distance
        text = _text(0.5 * (a + b), line + TEXT + 1, _number(end - start))
        return _line(a, line, b, line) + "".join(_line(x, line - _TICK, x, line + _TICK) for x in (a, b)) + text

    def beside(self, start: float, end: float, x: float, distance: float) -> str:
        """SVG elements of a dimension line along the second coordinate, ``distance`` pixels to the right of ``x``;
        negative is left.
        """
        (line, a), (_, b) = self.at(x, start), self.at(x, end)
        line += distance
        anchor, shift = ("start", 7) if distance > 0 else ("end", -7)
        text = _text(line + shift, 0.5 * (a + b) + TEXT / 3, _number(end - start), anchor)
        return _line(line, a, line, b) + "".join(_line(line - _TICK, y, line + _TICK, y) for y in (a, b)) + text

    def label(self, point: Point, words: str) -> str:
        x, y = self.at(*point)
        return _text(x, y + TEXT / 3, words)

    def lines(self, segments: np.ndarray) -> str:
        """SVG elements that draw segments (S, 2, 2), given in mm."""
        ends = ((self.at(*start), self.at(*end)) for start, end in segments.tolist())
        path = "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for (a, b), (c, d) in ends)
        return f'<path d="{path}" stroke="currentColor" stroke-width="1.2" fill="none"/>'


def _section_path(pad: Pad, centres: Iterable[float], view: _PlaneView) -> str:
    """Outline of a section: along the bottom and into each cell, then back along the top."""
    half, radius, sphere = 0.5 * pad.extent[0], 0.5 * pad.cell_size, pad.shape.roof_radius
    path = f"M{_pair(view.at(-half, 0))}"
    for x in centres:
        if sphere is None or pad.top_x or pad.fillet or pad.mouth_fillet:
            path += "".join(f"L{_pair(view.at(x + offset, z))}" for offset, z in pad.shape.section().tolist())
            continue
        arc = f"{view.scale * sphere:.2f}"
        roof = f"A{arc} {arc} 0 0 1 " if math.isfinite(sphere) else "L"
        path += f"L{_pair(view.at(x - radius, 0))}L{_pair(view.at(x - radius, pad.side_height))}"
        path += f"{roof}{_pair(view.at(x + radius, pad.side_height))}L{_pair(view.at(x + radius, 0))}"
    radius, top = pad.outer_fillet, pad.height
    path += f"L{_pair(view.at(half, 0.0))}"
    arc = f"A{view.scale * radius:.2f} {view.scale * radius:.2f} 0 0 0 "
    for start, end in (((half, top - radius), (half - radius, top)), ((radius - half, top), (-half, top - radius))):
        path += f"L{_pair(view.at(*start))}" + (f"{arc}{_pair(view.at(*end))}" if radius else "")
    return path + "Z"


def _plan_path(pad: Pad, view: _PlaneView) -> str:
    """Outline of the pad and of each cell seen from above, as the data of an SVG path."""
    length, depth, _ = (view.scale * extent for extent in pad.extent)
    outer = view.scale * pad.outer_fillet
    x, y = view.at(-0.5 * pad.extent[0], 0.5 * pad.extent[1])
    path = f"M{_pair((x + outer, y))}"
    sides = (("h", length, (1, 1)), ("v", depth, (-1, 1)), ("h-", length, (-1, -1)), ("v-", depth, (1, -1)))
    for line, side, (x_sign, y_sign) in sides:
        arc = f"a{outer:.2f} {outer:.2f} 0 0 1 {x_sign * outer:.2f} {y_sign * outer:.2f}" if outer else ""
        path += f"{line}{side - 2 * outer:.2f}{arc}"
    path += "Z"
    size, radius = view.scale * pad.cell_size, 0.5 * view.scale * pad.cell_size
    for x, y in pad.cell_centres:
        left_end, middle = view.at(x - 0.5 * pad.cell_size, y)
        if pad.shape.is_square:
            fillet, straight = view.scale * pad.fillet, size - 2 * view.scale * pad.fillet
            path += f"M{_pair((left_end + fillet, middle - radius))}"
            for line, (x_sign, y_sign) in (("h", (1, 1)), ("v", (-1, 1)), ("h-", (-1, -1)), ("v-", (1, -1))):
                arc = f"a{fillet:.2f} {fillet:.2f} 0 0 1 {x_sign * fillet:.2f} {y_sign * fillet:.2f}"
                path += f"{line}{straight:.2f}{arc if fillet else ''}"
            path += "Z"
        else:
            half = f"a{radius:.2f} {radius:.2f} 0 0 1 "
            path += f"M{_pair((left_end, middle))}{half}{size:.2f} 0{half}{-size:.2f} 0Z"
    return path


def _segments(vertices: np.ndarray, triangles: np.ndarray, axis: int, height: float) -> np.ndarray:
    """Segments (S, 2, 3) in which triangles intersect the plane at a height along an axis."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    return trimesh.intersections.mesh_plane(mesh, np.eye(3)[axis], height * np.eye(3)[axis])


def _svg(words: str, width: float, height: float, elements: list[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(words)}" '
        f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'font-family="sans-serif" font-size="{TEXT}"><title>{escape(words)}</title>{"".join(elements)}</svg>'
    )


def _line(a: float, b: float, c: float, d: float) -> str:
    return f'<path d="M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" stroke="currentColor" stroke-width="0.8" fill="none"/>'


def _text(x: float, y: float, words: str, anchor: str = "middle") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="currentColor">{escape(words)}</text>'


def _number(length: float) -> str:
    return f"{length:.4g}"


def _pair(point: Point) -> str:
    return f"{point[0]:.2f} {point[1]:.2f}"
