"""Error of readings due to the mechanics: light is traced again through pads displaced by each component of this error.

All traces have the same random numbers, so that few points resolve a small change. A reading may rise with one
component and fall with another. Their sizes are known but not their signs, so that a sum could cancel by chance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
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
    """Error of the mechanics of each loaded pad.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[RoofError or None]
        Errors of the pads in the order of the scene; None if unknown.
    """
    with stages.stage("mechanics"):
        return [pad.state.error for pad in loaded_pads(scene)]


def mechanics_deviations(scene: mi.Scene, powers: Callable[[], np.ndarray]) -> tuple[np.ndarray, np.ndarray | None]:
    """Powers, and their changes by the components of the deviation of coarser finite elements.

    Parameters
    ----------
    scene : mi.Scene
        Scene with a loaded pad; its pads are restored on return.
    powers : Callable[[], ndarray]
        Traces the present scene, always with the same random numbers, and returns powers (R, T) in W.

    Returns
    -------
    before : (R, T) ndarray
        Powers in W.
    changes : (C, R, T) ndarray or None
        Changes in W by two components of the deviation, and by a third if a pad has mirrors; None if the error of a pad
        is unknown.
    """
    pads = loaded_pads(scene)
    with stages.stage("mechanics"):
        fraction = min(pad.state.probed_share for pad in pads)
        surfaces = [pad.deviating_places(fraction) or [] for pad in pads]
    before = powers()
    if not all(surfaces):
        return before, None
    # A pad without mirrors has no third component: it stays where it is.
    changes = []
    undisturbed = [places_of(pad)._replace(region=pad.changing_region()) for pad in pads]
    with restored(scene, pads):
        for component in zip_longest(*surfaces):
            move(scene, pads, [places or rest for places, rest in zip(component, undisturbed, strict=True)])
            changes.append((powers() - before) / fraction)
    return before, np.array(changes)


def combined(changes: np.ndarray) -> np.ndarray:
    """The root of the sum of the squares of changes (C, ...), with the sign of the first."""
    return np.copysign(np.linalg.norm(changes, axis=0), changes[0])


@contextmanager
def moved(scene: mi.Scene, pads: Sequence[PadShape], surfaces: list[Places]) -> Iterator[None]:
    """Move the vertices of pads within a block.

    Parameters
    ----------
    scene : mi.Scene
        Scene that holds the pads.
    pads : Sequence[PadShape]
        Pads whose vertices move.
    surfaces : list[Places]
        Vertices of each pad within the block.

    Yields
    ------
    None
        With the vertices moved; they are restored afterwards.
    """
    with restored(scene, pads):
        move(scene, pads, surfaces)
        yield


@contextmanager
def restored(scene: mi.Scene, pads: Sequence[PadShape]) -> Iterator[None]:
    """Restore the vertices of pads after a block.

    Parameters
    ----------
    scene : mi.Scene
        Scene that holds the pads.
    pads : Sequence[PadShape]
        Pads that the block may move.

    Yields
    ------
    None
        Nothing; the vertices are unchanged within the block.
    """
    before = [places_of(pad)._replace(region=pad.changing_region()) for pad in pads]
    try:
        yield
    finally:
        move(scene, pads, before)


def move(scene: mi.Scene, pads: Sequence[PadShape], surfaces: list[Places]) -> None:
    """Move the vertices of pads.

    Parameters
    ----------
    scene : mi.Scene
        Scene that holds the pads.
    pads : Sequence[PadShape]
        Pads whose vertices move.
    surfaces : list[Places]
        New vertices of each pad.
    """
    with stages.stage("load"):
        for pad, surface in zip(pads, surfaces, strict=True):
            move_vertices(pad, surface)
        scene.parameters_changed([])
