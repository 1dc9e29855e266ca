"""Closed surfaces of revolution, and prisms."""

from __future__ import annotations

import numpy as np

SECTORS = 96
"""Number of flat sides of a surface of revolution."""


def revolved(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface of revolution of an outline about z.

    Parameters
    ----------
    outline : (n, 2) ndarray
        Distance from the axis and height in mm; the first and the last point are on the axis.

    Returns
    -------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray
        Counter-clockwise seen from outside.
    """
    import trimesh

    body = trimesh.creation.revolve(outline, sections=SECTORS)
    return np.asarray(body.vertices), np.asarray(body.faces)


def prism(section: np.ndarray, half_length: float) -> tuple[np.ndarray, np.ndarray]:
    """The surface of a prism along x, from ``-half_length`` to ``half_length`` in mm.

    Parameters
    ----------
    section : (n, 2) ndarray
        Corners along y and z in mm, counter-clockwise; all of them are visible from their mean.
    half_length : float
        Half the length along x, mm.

    Returns
    -------
    vertices : (2 n + 2, 3) ndarray
        Positions in mm.
    triangles : (4 n, 3) ndarray
        Counter-clockwise seen from outside.
    """
    ends = [np.insert(section, 0, end, axis=1) for end in (half_length, -half_length)]
    middles = [end.mean(axis=0, keepdims=True) for end in ends]
    count = len(section)
    corner = np.arange(count)
    following = np.roll(corner, -1)
    front = np.stack([corner, following, np.full(count, 2 * count)], axis=1)
    rear = np.stack([count + following, count + corner, np.full(count, 2 * count + 1)], axis=1)
    sides = [
        np.stack([corner, count + corner, count + following], axis=1),
        np.stack([corner, count + following, following], axis=1),
    ]
    return np.concatenate([*ends, *middles]), np.concatenate([front, rear, *sides])
