"""Notes on the finishes (textures) of cells' walls, with their parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.parameters import REQUIRED, parameters_of
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi

    from mitsuba_taxel.mechanics.surface.finish import Finish

MOST_NAMED = 3
"""Largest number of different finishes of a study that its notes name one by one."""


def finishes_of(scene: mi.Scene) -> dict[str, str]:
    """Return the finishes (textures) of the cells of a scene, such as
    ``{"roof and side": "layer_steps, layer_height = 0.1 mm"}``.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    dict[str, str]
        Finish with its numbers by wall or pair of walls; empty for smooth cells.
    """
    finishes = [pad.finish for pad in deformed_pads(scene) if pad.finish is not None]
    if not finishes:  # without an import of the mechanics
        return {}
    from mitsuba_taxel.mechanics.surface.wall_finishes import by_walls

    walls = [wall for finish in finishes for wall in by_walls(finish)]
    return merged_finishes({" and ".join(regions): _words(kind)} for kind, regions in walls)


def finish_notes(finishes: Mapping[str, str]) -> list[str]:
    """A note for each wall, or pair of walls, with a finish.

    Parameters
    ----------
    finishes : Mapping[str, str]
        Result of `finishes_of` or `merged_finishes`.

    Returns
    -------
    list[str]
        Notes in the given order, such as "finish of roof and side: layer_steps, layer_height = 0.1 mm".
    """
    return [f"finish of {walls}: {words}" for walls, words in finishes.items()]


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


def merged_finishes(finishes: Iterable[Mapping[str, str]]) -> dict[str, str]:
    """Merge the finishes of many readings: all finishes of each wall.

    Parameters
    ----------
    finishes : iterable of Mapping[str, str]
        Finishes by wall, as `finishes_of` returns them.

    Returns
    -------
    dict[str, str]
        Distinct finishes by wall in the given order; of more than `MOST_NAMED`, the first and the last are named.
    """
    of_walls: dict[str, dict[str, None]] = {}
    for each in finishes:
        for walls, words in each.items():
            of_walls.setdefault(walls, {})[words] = None
    merged = {}
    for walls, distinct in of_walls.items():
        named = list(distinct)
        if len(named) > MOST_NAMED:
            named = [f"{len(named)} in turn, from {named[0]}", f"to {named[-1]}"]
        merged[walls] = "; ".join(named)
    return merged
