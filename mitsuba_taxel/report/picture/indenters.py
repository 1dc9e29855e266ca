"""Surfaces of indenters near their pads."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.kernels.protocols import PadShape


def indenter_surface(pad: PadShape, magnify: float = 1.0) -> tuple[np.ndarray, np.ndarray] | None:
    """Surface of the indenter of a loaded `deformable_pad`: vertices (V, 3) in mm and triangles (T, 3).

    If the indenter is larger than the pad, only its part around the tip is returned, up to the length of the pad. The
    result is None for a pad without an indenter.

    Parameters
    ----------
    magnify : float
        Factor on the displacement of the indenter.
    """
    load, state = pad.load, pad.state
    if load.indenter is None:
        return None
    assert state.indenter_moved is not None
    points, body = state.mesh.points, load.indenter.body
    vertices, triangles = body.surface(float(np.ptp(points, axis=0).max()))
    start = body.start(points[body.highest(points)])
    vertices = vertices + start + magnify * state.indenter_moved
    return vertices @ pad.to_world[:3, :3].T + pad.to_world[:3, 3], triangles
