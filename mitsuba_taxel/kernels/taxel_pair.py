"""An LED array and the phototransistor array that reads its light."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.kernels.protocols import LedEmitter, PhototransistorSensor


@dataclass(frozen=True)
class TaxelPair:
    """An `annular_led` and the `phototransistor` that reads its light, arrays of the same number of faces."""

    led: LedEmitter
    sensor: PhototransistorSensor

    @property
    def count(self) -> int:
        """Number of taxels."""
        return self.sensor.faces.count

    @property
    def coplanar(self) -> bool:
        """Whether LEDs and phototransistors lie in the same plane, so that there is no direct light."""
        # Pointers are compared, as Python wrappers of the same shape may differ.
        return self.led.get_shape().ptr == self.sensor.get_shape().ptr

    @property
    def is_below_windows(self) -> bool:
        """Whether dies lie below windows, where light is refracted."""
        return self.led.resin_index is not None or self.sensor.resin_index is not None
