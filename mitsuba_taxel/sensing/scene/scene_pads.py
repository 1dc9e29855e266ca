"""The deformable pads of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.kernels.protocols import PadShape, is_pad

if TYPE_CHECKING:
    import mitsuba as mi


def deformed_pads(scene: mi.Scene) -> list[PadShape]:
    """Find the `deformable_pad`s of a loaded scene, whether a load acts on them or not.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[PadShape]
        Pads in the order of the scene.
    """
    return [shape for shape in scene.shapes() if is_pad(shape) and shape.state is not None]


def loaded_pads(scene: mi.Scene) -> list[PadShape]:
    """Find the `deformable_pad`s of a scene that are displaced by their present load or an earlier load.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[PadShape]
        Pads in the order of the scene.
    """
    return [pad for pad in deformed_pads(scene) if pad.is_loaded]


def is_touched(scene: mi.Scene) -> bool:
    """Whether any pad of a scene touches a package."""
    return any(pad.surface.touches.any() for pad in deformed_pads(scene))


def contact_notes(scene: mi.Scene) -> list[str]:
    """Describe which cells rest on packages with their walls.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[str]
        A sentence for each pad that rests on a package.
    """
    notes = []
    for pad in deformed_pads(scene):
        cells = np.unique(pad.surface.cell[pad.surface.shut & (pad.surface.cell > 0)]).tolist()
        if cells:
            whose = f"cell {cells[0]} rests" if len(cells) == 1 else f"cells {', '.join(map(str, cells))} rest"
            notes.append(f"the roof of {whose} on a package: no light passes where they touch")
    return notes
