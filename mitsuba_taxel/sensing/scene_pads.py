"""The deformable pads of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mitsuba_taxel.kernels.protocols import PadShape, is_pad

if TYPE_CHECKING:
    import mitsuba as mi


def deformed_pads(scene: mi.Scene) -> list[PadShape]:
    """The `deformable_pad`s of an ``mi.Scene``, loaded or not."""
    return [shape for shape in scene.shapes() if is_pad(shape) and shape.state is not None]


def loaded_pads(scene: mi.Scene) -> list[PadShape]:
    """The loaded ones."""
    return [pad for pad in deformed_pads(scene) if pad.is_loaded]
