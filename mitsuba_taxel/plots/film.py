"""The film of a study of images: an animated PNG, which browsers play."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.files.atomic import replacing

MOST_FRAMES = 500
"""Largest number of frames; of more pictures, that many are shown, evenly chosen."""
FRAME = 200
"""Time in ms for which a frame is shown."""


def write_film(pictures: Sequence[Path], file: Path) -> None:
    """Write pictures of the same size as the frames of an animated PNG (APNG), which is played again and again.

    Parameters
    ----------
    pictures : sequence of Path
        PNG files in the order of the film, at least one.
    file : Path
        The film, which is replaced if it exists.
    """
    from PIL import Image

    places = np.linspace(0, len(pictures) - 1, min(len(pictures), MOST_FRAMES)).round().astype(int)
    first, *others = (Image.open(pictures[place]).convert("RGB") for place in places)
    with replacing(file) as temporary:
        first.save(temporary, format="PNG", save_all=True, append_images=others, duration=FRAME, loop=0)
