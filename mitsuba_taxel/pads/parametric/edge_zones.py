"""Zones beside the rounded edges of mouths and of the outside, which keep their shape when dimensions change.

Within a zone, which is as wide as the fillet, the silicone is scaled with the radius about the sharp edge, so that
arcs remain arcs; beyond it, the change fades out."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.parametric.solid import nearest_cells


def carried(origin: DrawnPad, pad: DrawnPad, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Correct points that have moved with the dimensions of a pad, so that they keep their place beside its rounded
    edges.

    Parameters
    ----------
    origin, pad : DrawnPad
        The pads before and after, in mm, upright and with sharp edges; both have the same kinds of fillets.
    before, after : (N, 3) ndarray
        Positions in both pads, mm.

    Returns
    -------
    (N, 3) ndarray
        Corrected positions in the second pad, mm.
    """
    after = after.copy()
    if origin.mouth is not None and pad.mouth is not None:
        old, new, cell = origin.mouth, pad.mouth, nearest_cells(before, origin)
        axes = [np.column_stack([np.array(each.cell_centres)[cell], np.zeros(len(cell))]) for each in (origin, pad)]
        d, z = old.coordinates(before - axes[0])[0], before[:, 2]
        moved_d, outwards = new.coordinates(after - axes[1])
        weight = _fading(d, old.width, 0.5 * (old.width + old.beside))
        weight *= _fading(z, old.height, 0.5 * (old.height + old.straight))
        shift_z = weight * (_scaled(z, old.height, new.height) - after[:, 2])
        across = weight * (_scaled(d, old.width, new.width) - moved_d) + new.slope * shift_z
        after[:, :2] += across[:, None] * outwards
        after[:, 2] += shift_z
    if origin.outside is not None and pad.outside is not None:
        old_radius, radius = origin.outside.radius, pad.outside.radius
        halves = [np.array([0.5, 0.5, 1.0]) * each.extent for each in (origin, pad)]
        depth, moved_depth = (half - np.abs(points) for half, points in zip(halves, (before, after), strict=True))
        mouth = 0.0 if origin.mouth is None else origin.mouth.width
        fades = 0.5 * (old_radius + np.array([origin.wall - mouth, origin.wall - mouth, origin.height]))
        weight = np.stack([_fading(depth[:, k], old_radius, fades[k]) for k in range(3)], axis=1)
        weight[:, 2] *= weight[:, :2].max(axis=1)  # not above the cells
        after -= np.where(before < 0, -1.0, 1.0) * weight * (_scaled(depth, old_radius, radius) - moved_depth)
    return after


def _fading(distance: np.ndarray, width: float, end: float) -> np.ndarray:
    """Weights (N,) of points, from their distances (N,): 1 up to the distance ``width``, then falling to 0 at ``end``.
    """
    return np.clip((end - distance) / (end - width), 0.0, 1.0)


def _scaled(distance: np.ndarray, old: float, new: float) -> np.ndarray:
    """Distances (N,) from an edge after its zone has changed from the width ``old`` to ``new``: points in the zone are
    scaled, points beyond it are shifted.
    """
    return np.where(distance <= old, distance * (new / old), distance + new - old)
