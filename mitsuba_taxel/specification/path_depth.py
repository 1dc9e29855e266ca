"""Length of paths: parameters common to two integrators."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import whole
from mitsuba_taxel.specification.specification import Specification

MOST_REFLECTIONS = 1 << 17
"""Number of reflections after which a path without absorption is terminated."""


@dataclass(frozen=True)
class PathDepth(Specification):
    """Limits of the length of light paths, common to the integrators `taxel_tracer` and `taxel_path`."""

    max_depth: int = whole(
        -1,
        -1,
        MOST_REFLECTIONS,
        f"Largest number of reflections; -1 for no limit except the {MOST_REFLECTIONS} after which a path without "
        "absorption is terminated.",
    )
    rr_depth: int = whole(8, 0, 1 << 20, "Reflections after which paths of little weight may end by Russian roulette.")
