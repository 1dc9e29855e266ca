"""Generate ``hexagonal.stl``: seven cylindrical cells in a honeycomb, as a CAD program would export them.

python -m mitsuba_taxel.scenes.hexagonal hexagonal.stl
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

PITCH, HEIGHT, CELL_SIZE, CELL_HEIGHT = 3.55, 4.55, 2.55, 1.55
"""Dimensions of the paper's pad, mm."""
CORNERS = 48
"""Corners of the polygon that approximates a circle: a multiple of 6."""


def centres() -> np.ndarray:
    """x and y (7, 2) of the cells in mm: rows of two, three and two, in the order of their numbers."""
    row = PITCH * np.sqrt(0.75)
    rows = [(row, (-0.5, 0.5)), (0.0, (-1, 0, 1)), (-row, (-0.5, 0.5))]
    return np.array([(PITCH * x, y) for y, columns in rows for x in columns])


def triangles() -> np.ndarray:
    """Corners (T, 3, 3) of the triangles in mm, counter-clockwise seen from outside."""
    angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    to_edge = (angle + np.pi / 6) % (np.pi / 3) - np.pi / 6
    circle, hexagon = 0.5 * CELL_SIZE * direction, 0.5 * PITCH * direction / np.cos(to_edge)[:, None]
    middle = np.zeros_like(circle)
    tile = np.concatenate(
        [
            _band(hexagon, 0, circle, 0),
            _band(circle, 0, circle, CELL_HEIGHT),
            _band(circle, CELL_HEIGHT, middle, CELL_HEIGHT),
            _band(middle, HEIGHT, hexagon, HEIGHT),
        ]
    )
    everywhere = centres()
    shapes = [tile + (x, y, 0) for x, y in everywhere]
    wall = _band(hexagon, HEIGHT, hexagon, 0)
    across = _normals(wall)[:, :2]
    across *= PITCH / np.linalg.norm(across, axis=1, keepdims=True)
    for centre in everywhere:
        to_neighbour = np.linalg.norm((centre + across)[:, None] - everywhere, axis=-1)
        outside = to_neighbour.min(axis=1) > 0.5 * PITCH
        shapes.append(wall[outside] + (*centre, 0))
    return np.concatenate(shapes)


def _band(lower: np.ndarray, lower_z: float, upper: np.ndarray, upper_z: float) -> np.ndarray:
    """Triangles between two rings of points (C, 2) at their heights; a fan if a ring is one point."""
    a = np.insert(lower, 2, lower_z, axis=1)
    b = np.insert(upper, 2, upper_z, axis=1)
    a_next, b_next = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    both = np.concatenate([np.stack([a, b_next, a_next], axis=1), np.stack([a, b, b_next], axis=1)])
    return both[np.linalg.norm(_normals(both), axis=1) > 1e-9]


def _normals(corners: np.ndarray) -> np.ndarray:
    first, second, third = corners.swapaxes(0, 1)
    return np.cross(second - first, third - first)


def write(path: str | Path) -> None:
    """Write the pad as a binary STL file."""
    corners = triangles()
    rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = corners
    normals = _normals(corners)
    rows["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    header = b"seven cells in a honeycomb, mm".ljust(80) + len(rows).to_bytes(4, "little")
    Path(path).write_bytes(header + rows.tobytes())


if __name__ == "__main__":
    write(sys.argv[1])
