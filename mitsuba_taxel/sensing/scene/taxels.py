"""Pairing of LEDs and phototransistors."""

from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_led, is_phototransistor
from mitsuba_taxel.kernels.taxel_pair import TaxelPair


def taxels_of(scene: mi.Scene) -> list[TaxelPair]:
    """Pair the LEDs and phototransistors of a scene, in their order in the scene.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[TaxelPair]
        Pairs of an array of LEDs and an array of phototransistors.

    Raises
    ------
    InputError
        if an emitter is not an `annular_led`, if a sensor is not a `phototransistor`, or if the numbers of LEDs and
        phototransistors differ.
    """
    leds = scene.emitters()
    sensors = scene.sensors()
    for emitter in leds:
        if not is_led(emitter):
            raise InputError(f"every emitter must be an annular_led, not a {kind_of(emitter)}.", emitter)
    refuse_foreign_sensors(scene)
    counts = [sum(end.faces.count for end in ends) for ends in (leds, sensors)]
    if counts[0] != counts[1] or len(leds) != len(sensors):
        raise InputError(
            f"the scene holds {counts[0]} LEDs and {counts[1]} phototransistors: one of each for every taxel is needed."
        )
    return [TaxelPair(led, sensor) for led, sensor in zip(leds, sensors, strict=True)]


def taxel_positions(pairs: Sequence[TaxelPair]) -> np.ndarray:
    """Centres of the phototransistors of a scene, along x and y of the first of their boards.

    Parameters
    ----------
    pairs : sequence of TaxelPair
        Arrays of LEDs and phototransistors, from :func:`taxels_of`.

    Returns
    -------
    (T, 2) ndarray
        Coordinates in mm, in the order of the taxels.
    """
    faces = [pair.sensor.faces for pair in pairs]
    centres = np.concatenate([np.array(grid.centres).T for grid in faces])
    axes = np.stack([np.array(axis).ravel() for axis in (faces[0].frame.s, faces[0].frame.t)], axis=1)
    return (centres @ axes).astype(float)


def refuse_foreign_sensors(scene: mi.Scene) -> None:
    """Raise `InputError` if a scene lacks emitters or phototransistors, or has sensors of other kinds."""
    emitters, sensors = scene.emitters(), scene.sensors()
    for sensor in sensors:
        if not is_phototransistor(sensor):
            raise InputError(f"every sensor must be a phototransistor, not a {kind_of(sensor)}.", sensor)
    if not emitters or not sensors:
        raise InputError(
            f"the scene holds {len(emitters)} LEDs and {len(sensors)} phototransistors: at least one of each is needed."
        )
