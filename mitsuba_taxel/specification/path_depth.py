"""How long paths are: what two integrators have in common."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import whole
from mitsuba_taxel.specification.specification import Specification

MOST_REFLECTIONS = 1 << 17
"""After which a path is left that nothing absorbs."""


@dataclass(frozen=True)
class PathDepth(Specification):
    """Length of paths."""

    max_depth: int = whole(
        -1,
        -1,
        MOST_REFLECTIONS,
        f"Most reflections on a path; -1 for no limit but the {MOST_REFLECTIONS} after which a path that nothing "
        "absorbs is left.",
    )
    rr_depth: int = whole(8, 0, 1 << 20, "Reflections after which paths of little weight may end by Russian roulette.")
