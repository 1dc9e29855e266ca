"""Which LED is read by which phototransistor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.clearance import refuse_contact


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
        return self.led.get_shape().ptr == self.sensor.get_shape().ptr  # wrappers in Python may differ


def taxels_of(scene: mi.Scene) -> list[TaxelPair]:
    """Pairs of LEDs and phototransistors, in the order in which the scene lists them.

    Raises
    ------
    InputError
        if an emitter is no `annular_led`, a sensor is no `phototransistor`, or their numbers differ, or if another
        surface lies where one of them is, so that nobody could say which of the two a ray hits.
    ComputationError
        if a deformed pad touches a package.
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
        raise InputError(
            f"the scene holds {len(leds)} LEDs and {len(sensors)} phototransistors: at least one of each is needed."
        )
    counts = [sum(part.faces.count for part in parts) for parts in (leds, sensors)]
    if counts[0] != counts[1] or len(leds) != len(sensors):
        raise InputError(
            f"the scene holds {counts[0]} LEDs and {counts[1]} phototransistors: one of each for every taxel is needed."
        )
    pairs = [TaxelPair(led, sensor) for led, sensor in zip(leds, sensors, strict=True)]
    _refuse_shared_places(scene, pairs)
    refuse_contact(scene)
    return pairs


def _refuse_shared_places(scene: mi.Scene, pairs: list[TaxelPair]) -> None:
    """Raise an InputError where a rectangle lies in the plane of an LED or a phototransistor, on it and facing alike.

    One that faces the other way touches it, as a plate may, and light between the two goes nowhere.
    """
    rectangles = [(shape, _matrix_of(shape)) for shape in scene.shapes() if shape.class_name() == "Rectangle"]
    for pair in pairs:
        for name, part in (("annular_led", pair.led), ("phototransistor", pair.sensor)):
            for shape, to_world in rectangles:
                if shape.ptr != part.get_shape().ptr and _lies_on(part.faces, to_world):
                    raise InputError(
                        f"{name}: the rectangle {shape.id()!r} lies in its plane and overlaps it, so that light would "
                        "hit either: move or shrink one of them."
                    )


def _matrix_of(rectangle: mi.Shape) -> np.ndarray:
    return np.array(mi.traverse(rectangle)["to_world"].matrix, dtype=float).reshape(4, 4)


def _lies_on(faces: Any, to_world: np.ndarray) -> bool:
    """Whether the rectangle [-1, 1]² under ``to_world`` overlaps any of ``faces``, in their plane and facing alike."""
    frame = np.column_stack([np.array(axis).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    half = 0.5 * np.array(faces.size).ravel()
    centres = np.array(faces.centres).T @ frame
    middle, sides = to_world[:3, 3] @ frame, (to_world[:3, :2].T @ frame)[:, :2]
    across = np.abs((to_world[:3, :2].T @ frame)[:, 2]).sum()
    step = 1e-5 * 2 * np.sqrt(half.prod()) + 3e-6 * np.abs(to_world[:3, 3]).max()  # as far as rays are kept clear
    if np.cross(to_world[:3, 0], to_world[:3, 1]) @ frame[:, 2] <= 0 or across > step:
        return False
    offset = middle - centres
    here = np.abs(offset[:, 2]) <= step
    # Two rectangles are apart if they are so along one of the normals of their sides.
    for normal in (*np.eye(2), *(sides @ [[0, 1], [-1, 0]])):
        reach = np.abs(normal) @ half + np.abs(sides @ normal).sum()
        here &= np.abs(offset[:, :2] @ normal) < reach * (1 - 1e-5)
    return bool(here.any())
