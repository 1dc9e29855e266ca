"""Parameters of the integrator that starts at the LEDs."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import choice
from mitsuba_taxel.specification.path_depth import PathDepth

STRATEGIES = {
    "all": "",
    "connections": "each reflection is connected to a point of the phototransistor",
    "sensor_subpath_connections": "each vertex is connected to the first surface point on a ray from the "
    "phototransistor",
    "unidirectional_hits": "paths that reach the phototransistor without a connection",
}


@dataclass(frozen=True)
class TaxelTracer(PathDepth):
    """Integrator whose light paths start at the LEDs."""

    plugin = "taxel_tracer"

    strategy: str = choice(
        "all",
        STRATEGIES,
        "All techniques, or a single technique for tests. A single technique may miss light: only unidirectional hits "
        "find light reflected by a mirror.",
    )
