"""Error of readings due to the finite elements: light is traced again in pads that are displaced by each component of
the error of their shape.

All traces use the same random numbers, so that few points resolve a small change. A reading may rise with one component
and fall with another. The sizes of the components are known but their signs are not: added up, their effects could
cancel by chance. Each component is therefore traced separately.
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
    """Finite-element error of the shape of each loaded pad.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[RoofError or None]
        Errors of the roofs of each pad, in the order of the scene; None if unknown.
    """
    with stages.stage("mechanics"):
        return [pad.state.error for pad in loaded_pads(scene)]


def mechanics_deviations(scene: mi.Scene, powers: Callable[[], np.ndarray]) -> tuple[np.ndarray, np.ndarray | None]:
    """Trace the powers of a scene, and their changes if the pads have the shape that coarser finite elements give.

    Parameters
    ----------
    scene : mi.Scene
        Scene with a loaded pad; its pads are restored on return.
    powers : Callable[[], ndarray]
        Traces the present scene, always with the same random numbers, and returns the powers (R, T) in W of T taxels in
        R replicates.

    Returns
    -------
    before : (R, T) ndarray
        Powers in W with the pads unchanged.
    changes : (C, R, T) ndarray or None
        Changes of the powers in W by each of C components of the change of shape: two, or three if a pad has mirrors.
        None if the error of a pad is unknown.
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
    """Root of the sum of the squares of C changes (C, ...), over the first axis. The sign is that of the first change.
    """
    return np.copysign(np.linalg.norm(changes, axis=0), changes[0])


@contextmanager
def moved(scene: mi.Scene, pads: Sequence[PadShape], surfaces: list[Places]) -> Iterator[None]:
    """Move the vertices of pads within the block, and restore them afterwards.

    Parameters
    ----------
    scene : mi.Scene
        Scene that holds the pads.
    pads : Sequence[PadShape]
        Pads whose vertices move.
    surfaces : list[Places]
        Positions of the vertices of each pad within the ``with`` block.

    Yields
    ------
    None
        Nothing; the vertices are moved within the ``with`` block.
    """
    with restored(scene, pads):
        move(scene, pads, surfaces)
        yield


@contextmanager
def restored(scene: mi.Scene, pads: Sequence[PadShape]) -> Iterator[None]:
    """Restore the vertices of pads after the block, whatever it moves.

    Parameters
    ----------
    scene : mi.Scene
        Scene that holds the pads.
    pads : Sequence[PadShape]
        Pads whose vertices the block may move.

    Yields
    ------
    None
        Nothing; the vertices are not yet moved when the block begins.
    """
    before = [places_of(pad)._replace(region=pad.changing_region()) for pad in pads]
    try:
        yield
    finally:
        move(scene, pads, before)


def move(scene: mi.Scene, pads: Sequence[PadShape], surfaces: list[Places]) -> None:
    """Move the vertices of pads to other surfaces.

    Parameters
    ----------
    scene : mi.Scene
        Scene that holds the pads.
    pads : Sequence[PadShape]
        Pads whose vertices move.
    surfaces : list[Places]
        New positions of the vertices of each pad.
    """
    with stages.stage("load"):
        for pad, surface in zip(pads, surfaces, strict=True):
            move_vertices(pad, surface)
        scene.parameters_changed([])
