"""Which LED is read by which phototransistor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi

from mitsuba_taxel.errors import InputError


@dataclass(frozen=True)
class TaxelPair:
    """An `annular_led` and the `phototransistor` read against it, each an array of the same number of faces."""

    led: Any
    sensor: Any

    @property
    def count(self) -> int:
        """How many taxels the pair holds."""
        return self.sensor.faces.count

    @property
    def coplanar(self) -> bool:
        """Whether LEDs and phototransistors lie in one plane, so that no light goes straight across."""
        return self.led.get_shape() is self.sensor.get_shape()


def taxels_of(scene: mi.Scene) -> list[TaxelPair]:
    """Pairs of LEDs and phototransistors, in the order in which the scene lists them.

    Raises
    ------
    InputError
        if an emitter is no `annular_led`, a sensor is no `phototransistor`, or their numbers differ.
    """
    leds = scene.emitters()
    sensors = scene.sensors()
    for emitter in leds:
        if not hasattr(emitter, "sample_direction_of_emission"):
            raise InputError(f"every emitter must be an annular_led, not a {emitter.class_name()}.")
    for sensor in sensors:
        if not hasattr(sensor, "spread_film"):
            raise InputError(f"every sensor must be a phototransistor, not a {sensor.class_name()}.")
    if not leds or not sensors:
        raise InputError(f"the scene holds {len(leds)} LEDs and {len(sensors)} phototransistors: at least one of each.")
    counts = [sum(part.faces.count for part in parts) for parts in (leds, sensors)]
    if counts[0] != counts[1] or len(leds) != len(sensors):
        raise InputError(f"the scene holds {counts[0]} LEDs and {counts[1]} phototransistors: each needs its own.")
    return [TaxelPair(led, sensor) for led, sensor in zip(leds, sensors, strict=True)]
