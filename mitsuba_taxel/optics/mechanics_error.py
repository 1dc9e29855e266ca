"""What the error of the mechanics does to readings: the light is traced once more, through pads displaced by it.

Both traces share their random numbers, so that few points tell a small change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel import stages
from mitsuba_taxel.optics.mesh_adapter import move_vertices


def loaded_pads(scene: mi.Scene) -> list[Any]:
    """The `deformable_pad`s of a scene that bear a load."""
    return [shape for shape in scene.shapes() if hasattr(shape, "state") and any(shape.value)]


def mechanics_deviation(scene: mi.Scene, powers: Callable[[], np.ndarray]) -> tuple[np.ndarray, np.ndarray | None]:
    """(R, T) W: powers, and by how much they change where pads have the shape that coarser finite elements give them.

    Parameters
    ----------
    powers : traces the scene as it is, always with the same random numbers; (R, T) W

    Returns
    -------
    In place of the change None, if the error of a pad is not known. Pads are as before when this returns.
    """
    pads = loaded_pads(scene)
    with stages.stage("mechanics"):
        moved = [pad.deviating_vertices() for pad in pads]
    before = powers()
    if any(vertices is None for vertices in moved):
        return before, None
    with _moved(scene, pads, moved):
        return before, powers() - before


@contextmanager
def _moved(scene: mi.Scene, pads: list[Any], vertices: list[np.ndarray]) -> Iterator[None]:
    homes = [np.array(mi.traverse(pad)["vertex_positions"]).reshape(-1, 3) for pad in pads]
    _move(scene, pads, vertices)
    try:
        yield
    finally:
        _move(scene, pads, homes)


def _move(scene: mi.Scene, pads: list[Any], vertices: list[np.ndarray]) -> None:
    with stages.stage("load"):
        for pad, places in zip(pads, vertices, strict=True):
            move_vertices(pad, places)
        scene.parameters_changed([])
