"""Parameters of the sampler."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import whole
from mitsuba_taxel.specification.specification import Specification

MOST_POINTS = 1 << 20


@dataclass(frozen=True)
class OwenSobol(Specification):
    """Sampler of Owen-scrambled Sobol' points for light paths."""

    plugin = "owen_sobol"

    sample_count: int = whole(
        1024,
        1,
        MOST_POINTS,
        "Points per sequence (per pixel, or per taxel and randomisation); rounded up to a power of two.",
    )
    seed: int = whole(0, 0, 2**32 - 1, "Number that is added to the seed of the integrator.")
