"""Which integrator reads a scene that names none."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.optics.emission import UniformPolarAngle
from mitsuba_taxel.optics.parts import make_plugin
from mitsuba_taxel.optics.walls import is_bounded_from_detector, walls_of

_NARROW = 0.25
"""Acceptance below which paths from the phototransistor are the cheaper ones (measured: benchmarks, case narrow)."""


def choose_integrator(scene: Any) -> tuple[Any, str]:
    """The cheapest integrator that is right for a scene of LEDs and phototransistors, and why, in words."""
    if not all(map(is_bounded_from_detector, walls_of(scene))):
        return make_plugin("taxel_tracer"), "taxel_tracer: an isotropic wall is right only for paths from the LED"
    if any(isinstance(led.law, UniformPolarAngle) for led in scene.emitters()):
        return make_plugin("taxel_tracer"), "taxel_tracer: the LED's law has no bound on its axis, so paths start there"
    if all(_acceptance(sensor) < _NARROW for sensor in scene.sensors()):
        return make_plugin("taxel_path"), "taxel_path: the phototransistor sees little but what lies before it"
    return make_plugin("taxel_tracer"), "taxel_tracer: it joins paths from both ends, which is the cheapest here"


def _acceptance(sensor: Any) -> float:
    """Share of a uniform radiance that a phototransistor responds to, 1 if it is ideal: 2 int R(c) c dc."""
    cosines = (np.arange(1024) + 0.5) / 1024
    response = np.broadcast_to(np.array(sensor.response(mi.Float(cosines))), cosines.shape)
    return float(2 * np.mean(response * cosines))
