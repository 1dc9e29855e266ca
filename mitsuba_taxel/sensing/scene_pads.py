"""The deformable pads of a scene."""

from __future__ import annotations

from typing import Any


def deformed_pads(scene: Any) -> list[Any]:
    """The `deformable_pad`s among the shapes of an ``mi.Scene``, under a load or not."""
    return [shape for shape in scene.shapes() if hasattr(shape, "state")]


def loaded_pads(scene: Any) -> list[Any]:
    """Those that bear a load."""
    return [pad for pad in deformed_pads(scene) if any(pad.value)]
