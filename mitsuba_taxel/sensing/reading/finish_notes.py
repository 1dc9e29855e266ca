"""Notes on the finishes (textures) of cells' walls, with their parameters."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.parameters import REQUIRED, parameters_of
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi

    from mitsuba_taxel.mechanics.surface.finish import Finish

MOST_NAMED = 3
"""Largest number of different finishes of a study that its notes name one by one."""
_START = "finish of "


def finish_notes(scene: mi.Scene) -> list[str]:
    """Describe the finishes (textures) of the cells of a scene, such as "finish of roof and side: layer_steps,
    layer_height = 0.1 mm".

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[str]
        One line for each wall, or pair of walls, with a finish; no lines for smooth cells.
    """
    finishes = [pad.finish for pad in deformed_pads(scene) if pad.finish is not None]
    if not finishes:  # without an import of the mechanics
        return []
    from mitsuba_taxel.mechanics.surface.wall_finishes import by_walls

    walls = [wall for finish in finishes for wall in by_walls(finish)]
    return list(dict.fromkeys(f"{_START}{' and '.join(regions)}: {_words(kind)}" for kind, regions in walls))


def _words(finish: Finish) -> str:
    """The kind of a finish, its required parameters, and those of its other parameters that differ from their
    defaults."""
    from mitsuba_taxel.specification.deformable_pad import FINISHES  # scenes without a finish need no pads

    words = [next(word for word, kind in FINISHES.items() if kind is type(finish))]
    for field, parameter in parameters_of(type(finish)).items():
        value = getattr(finish, field)
        if parameter.default is REQUIRED or not np.array_equal(value, parameter.default):
            shown = ", ".join(f"{number:g}" for number in np.ravel(value))
            words.append(f"{parameter.name} = {shown} {parameter.unit}".strip())
    return ", ".join(words)


def merged_finishes(notes: Iterable[str]) -> list[str]:
    """Merge the notes of many readings: all finishes of one wall are listed in one line.

    Parameters
    ----------
    notes : iterable of str
        Distinct notes of all readings.

    Returns
    -------
    list[str]
        Notes in the given order; if a wall has more than `MOST_NAMED` finishes, the first and the last are named.
    """
    of_walls: dict[str, list[str]] = {}
    for note in notes:
        if note.startswith(_START):
            walls, words = note.split(": ", 1)
            of_walls.setdefault(walls, []).append(words)
        else:
            of_walls[note] = []
    lines = []
    for start, finishes in of_walls.items():
        if len(finishes) > MOST_NAMED:
            finishes = [f"{len(finishes)} in turn, from {finishes[0]}", f"to {finishes[-1]}"]
        lines.append(f"{start}: {'; '.join(finishes)}" if finishes else start)
    return lines
