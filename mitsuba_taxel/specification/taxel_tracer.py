"""Parameters of the integrator that starts at the LEDs."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import choice
from mitsuba_taxel.specification.path_depth import PathDepth

STRATEGIES = {
    "all": "",
    "connections": "each reflection is connected to a point of the phototransistor",
    "sensor_subpath_connections": "each vertex is connected to the surface point that a ray from the phototransistor "
    "finds first",
    "unidirectional_hits": "paths that arrive there by themselves",
}


@dataclass(frozen=True)
class TaxelTracer(PathDepth):
    """The integrator that starts at the LEDs."""

    plugin = "taxel_tracer"

    strategy: str = choice(
        "all",
        STRATEGIES,
        "All techniques, or one of them alone, to check it. Alone it sees only what it can: light by way of a mirror "
        "is seen by unidirectional hits alone.",
    )
