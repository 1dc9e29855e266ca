"""Error of readings by that of the mechanics: light is traced once more through pads displaced by each of its parts.

All traces share their random numbers, so that few points resolve a small change. A reading may rise with one part of
the error and fall with another; as their sizes are known but not their signs, a sum could cancel by chance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.kernels.surfaces.mesh_adapter import Places, move_vertices, places_of
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import RoofError


def roof_errors(scene: mi.Scene) -> list[RoofError | None]:
    """Error of the mechanics of each loaded pad; None if unknown.

    Parameters
    ----------
    scene : mi.Scene
        A loaded one.

    Returns
    -------
    list[RoofError or None]
        In the order of the scene.
    """
    with stages.stage("mechanics"):
        return [pad.state.error for pad in loaded_pads(scene)]


def mechanics_deviations(scene: mi.Scene, powers: Callable[[], np.ndarray]) -> tuple[np.ndarray, np.ndarray | None]:
    """(R, T) W, powers, and (2, R, T) W, their changes by the two parts of the deviation of coarser finite elements.

    Parameters
    ----------
    powers : Callable[[], ndarray]
        Traces the present scene, always with the same random numbers; (R, T) W.

    Returns
    -------
    None instead of the changes if the error of a pad is unknown. Pads are restored on return.
    """
    pads = loaded_pads(scene)
    with stages.stage("mechanics"):
        share = min(pad.state.probed_share for pad in pads)
        places = [pad.deviating_places(share) for pad in pads]
    before = powers()
    if any(there is None for there in places):
        return before, None
    changes = []
    with restored(scene, pads):
        for part in zip(*places, strict=True):
            move(scene, pads, list(part))
            changes.append((powers() - before) / share)
    return before, np.array(changes)


def combined(changes: np.ndarray) -> np.ndarray:
    """Changes (2, ...) combined: the root of the sum of their squares, with the sign of the first."""
    return np.copysign(np.hypot(*changes), changes[0])


@contextmanager
def moved(scene: mi.Scene, pads: Sequence[PadShape], places: list[Places]) -> Iterator[None]:
    """Temporarily move the vertices of pads."""
    with restored(scene, pads):
        move(scene, pads, places)
        yield


@contextmanager
def restored(scene: mi.Scene, pads: Sequence[PadShape]) -> Iterator[None]:
    """Restore the vertices of pads on exit."""
    homes = [places_of(pad)._replace(region=pad.changing_region()) for pad in pads]
    try:
        yield
    finally:
        move(scene, pads, homes)


def move(scene: mi.Scene, pads: Sequence[PadShape], places: list[Places]) -> None:
    """Move the vertices of pads."""
    with stages.stage("load"):
        for pad, there in zip(pads, places, strict=True):
            move_vertices(pad, there)
        scene.parameters_changed([])
