"""Parameters of the integrator that counts rays."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import whole
from mitsuba_taxel.specification.specification import Specification


@dataclass(frozen=True)
class AnalogTracer(Specification):
    """Integrator that traces rays of equal power and counts those that reach the phototransistor."""

    plugin = "analog_tracer"

    release_points: int = whole(
        20, 1, 1 << 20, "Points of the LED from which rays are released. The rays of a run are distributed over them."
    )
