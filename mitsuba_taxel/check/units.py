"""Numbers that are likely in another unit than that of the parameter: mm, N, MPa, nm and degrees are needed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, Part, Parts, UndeformedPad
from mitsuba_taxel.kernels.tables import RIGHT_ANGLE
from mitsuba_taxel.pads import Pad

_LENGTHS = {"m": 1e3, "µm": 1e-3, "nm": 1e-6}
_STRESSES = {"Pa": 1e-6, "kPa": 1e-3, "GPa": 1e3}
_WAVELENGTHS = {"µm": 1e3, "m": 1e9, "Å": 0.1}
LARGEST_STRAIN = 3.0
"""Stress of a load on the top of a pad, over Young's modulus: beyond, no pad stands it."""
SMALLEST_STRAIN = 2e-5
"""Below, no reading shows the load."""


@dataclass(frozen=True)
class Common:
    """The numbers that a parameter commonly has, its unit, and what one of each other unit is in it."""

    least: float
    most: float
    unit: str
    others: dict[str, float]

    def doubt(self, value: float) -> str:
        """What is odd about a value; empty if nothing is."""
        if value == 0 or not math.isfinite(value) or self.least <= abs(value) <= self.most:
            return ""
        meant = next((u for u, factor in self.others.items() if self.least <= abs(value) * factor <= self.most), "")
        hint = f"; if it is in {meant}, write {value * self.others[meant]:.4g}" if meant else ""
        return f"{self.least:g} to {self.most:g} {self.unit} is common{hint}"


COMMON = {
    PAD: {
        "pitch": Common(0.2, 200, "mm", _LENGTHS),
        "wall": Common(0.02, 100, "mm", _LENGTHS),
        "height": Common(0.2, 200, "mm", _LENGTHS),
        "cell_size": Common(0.1, 100, "mm", _LENGTHS),
        "cell_height": Common(0.05, 100, "mm", _LENGTHS),
        "patch_width": Common(0.02, 500, "mm", _LENGTHS),
        "patch_depth": Common(0.02, 500, "mm", _LENGTHS),
        "mesh_size": Common(0.02, 100, "mm", _LENGTHS),
        "layer_height": Common(0.002, 5, "mm", _LENGTHS),
        "groove_pitch": Common(0.002, 10, "mm", _LENGTHS),
        "correlation_length": Common(0.0005, 10, "mm", _LENGTHS),
        "youngs_modulus": Common(0.005, 100, "MPa", _STRESSES),
        "c10": Common(0.0005, 20, "MPa", _STRESSES),
    },
    "photo_reflector": {
        "body": Common(0.05, 100, "mm", _LENGTHS),
        "pitch": Common(0.1, 200, "mm", _LENGTHS),
        "spacing": Common(0.02, 100, "mm", _LENGTHS),
    },
    "annular_led": {
        "size": Common(0.002, 50, "mm", _LENGTHS),
        "wavelength": Common(200, 20_000, "nm", _WAVELENGTHS),
    },
    "phototransistor": {
        "width": Common(0.002, 100, "mm", _LENGTHS),
        "depth": Common(0.002, 100, "mm", _LENGTHS),
    },
}
"""Generous bounds: what lies beyond is a slip far more often than it is meant."""


def check_units(parts: Parts) -> Iterator[Finding]:
    """Numbers so far from the common that another unit must be meant, and loads that pull."""
    for part in parts.all:
        for name, common in COMMON.get(part.plugin, {}).items():
            if name in part.props.keys():
                yield from _doubts(part, name, common)
        if part.plugin == "annular_led" and "cone_angle" in part.props.keys():
            yield from _radians(part)
        if part.plugin == PAD and part.made is not None:
            yield from _of_load(part)


def _doubts(part: Part, name: str, common: Common) -> Iterator[Finding]:
    value = part.props[name]
    if isinstance(value, str | bool):
        return
    for component in np.atleast_1d(np.array(value, dtype=float)).tolist():
        doubt = common.doubt(component)
        if doubt:
            odd = f"{name} = {component:g} {common.unit} of {part.plugin} is odd: {doubt}."
            yield part.finding("warning", odd, name)
            return


def _radians(part: Part) -> Iterator[Finding]:
    angle = part.props["cone_angle"]
    if isinstance(angle, int | float) and 0 < angle <= RIGHT_ANGLE:
        beam = f"cone_angle = {angle:g} degrees of annular_led is a narrow beam"
        meant = f"if it is in radians, write {np.degrees(angle):.4g}"
        yield part.finding("warning", f"{beam}; {meant}.", "cone_angle")


def _of_load(part: Part) -> Iterator[Finding]:
    """Loads that pull, and loads far beyond or below what a pad shows."""
    pad = part.made
    if pad.load is None or not np.any(pad.load[1]):
        return
    load, given = pad.load[0], np.array(pad.load[1])
    said = f"{load.quantity} = {', '.join(f'{component:g}' for component in given)} {load.unit} of {PAD}"
    for odd in (_pull(load.quantity, given), _size(load.quantity, given, pad)):
        if odd:
            yield part.finding("warning", f"{said} {odd}.", load.quantity)


def _pull(quantity: str, value: np.ndarray) -> str:
    if quantity == "pressure":
        return "is suction: a pressure that compresses is above 0" if value[0] < 0 else ""
    return "pulls at the pad: compression is negative along z" if value[2] > 0 else ""


def _size(quantity: str, value: np.ndarray, pad: UndeformedPad) -> str:
    if pad.material is None or not isinstance(pad.pad, Pad):
        return ""
    x, y, z = pad.pad.extent
    size = float(np.linalg.norm(value))
    if quantity == "displacement":
        return f"is more than the height of the pad, {z:g} mm; if it is in µm, write it in mm" if size >= z else ""
    modulus = pad.material.youngs_modulus
    if COMMON[PAD]["youngs_modulus"].doubt(modulus):  # then the load cannot be judged
        return ""
    strain = size / (1 if quantity == "pressure" else x * y) / modulus
    smaller, larger, unit = ("mN", "kN", "N") if quantity == "force" else ("Pa or kPa", "GPa", "MPa")
    if strain > LARGEST_STRAIN:
        share = f"{strain:.2g} times Young's modulus on its top, which no pad stands"
        return f"is {share}; if it is in {smaller}, write it in {unit}"
    if strain < SMALLEST_STRAIN:
        share = f"{strain:.1g} of Young's modulus on its top, which no reading shows"
        return f"is {share}; if it is in {larger}, write it in {unit}"
    return ""
