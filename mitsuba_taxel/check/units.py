"""Numbers that are probably in the wrong unit: mm, N, MPa, nm and degrees are needed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, Parts, ScenePart, UndeformedPad
from mitsuba_taxel.kernels.tables import RIGHT_ANGLE
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.parameters import Number, Parameter, Vector
from mitsuba_taxel.specification import specifications

_OTHERS = {
    "mm": {"m": 1e3, "µm": 1e-3, "nm": 1e-6},
    "MPa": {"Pa": 1e-6, "kPa": 1e-3, "GPa": 1e3},
    "nm": {"µm": 1e3, "m": 1e9, "Å": 0.1},
}
"""Other units in terms of that of a parameter."""
LARGEST_STRAIN = 3.0
"""Largest stress of a load on the top of a pad, relative to Young's modulus, that a pad can bear."""
PLACES_LOOKED_AT = 41
"""Points along each side of a pad's top at which contact with an indenter is tested."""
SMALLEST_STRAIN = 2e-5
"""Least relative stress that shows in a reading."""


def doubt(parameter: Parameter, value: float) -> str:
    """Why a number is unusual; empty if it is not."""
    least, most = getattr(parameter, "common", None) or (0.0, math.inf)
    if value == 0 or not math.isfinite(value) or least <= abs(value) <= most:
        return ""
    others = _OTHERS.get(parameter.unit, {})
    meant = next((unit for unit, factor in others.items() if least <= abs(value) * factor <= most), "")
    hint = f"; if it is in {meant}, write {value * others[meant]:.4g}" if meant else ""
    return f"{f'{least:g} to {most:g} {parameter.unit}'.strip()} is common{hint}"


def check_units(parts: Parts) -> Iterator[Finding]:
    """Numbers so unusual that another unit must be meant, and loads that pull."""
    for part in parts.all:
        stated = specifications()[part.plugin].values() if part.plugin in specifications() else {}
        for name, parameter in stated.items():
            if name in part.props.keys():
                yield from _doubts(part, parameter)
        if part.plugin == "annular_led" and "cone_angle" in part.props.keys():
            yield from _radians(part)
        if part.plugin == PAD and part.made is not None:
            yield from _of_load(part)


def _doubts(part: ScenePart, parameter: Parameter) -> Iterator[Finding]:
    value = part.props[parameter.name]
    if not isinstance(parameter, Number | Vector) or isinstance(value, str | bool):
        return
    for component in np.atleast_1d(np.array(value, dtype=float)).tolist():
        odd = doubt(parameter, component)
        if odd:
            number = f"{component:g} {parameter.unit}".strip()
            said = f"{parameter.name} = {number} of {part.plugin} is odd: {odd}."
            yield part.finding("warning", said, parameter.name)
            return


def _radians(part: ScenePart) -> Iterator[Finding]:
    angle = part.props["cone_angle"]
    if isinstance(angle, int | float) and 0 < angle <= RIGHT_ANGLE:
        beam = f"cone_angle = {angle:g} degrees of annular_led is a narrow beam"
        meant = f"if it is in radians, write {np.degrees(angle):.4g}"
        yield part.finding("warning", f"{beam}; {meant}.", "cone_angle")


def _of_load(part: ScenePart) -> Iterator[Finding]:
    """Loads that pull, and loads far too large or too small for a pad."""
    pad = part.made
    if not np.any(pad.load[1]):
        return
    load, given = pad.load[0], np.array(pad.load[1])
    said = f"{load.quantity} = {', '.join(f'{component:g}' for component in given)} {load.unit} of {PAD}"
    for odd in (_pull(load.quantity, given), _size(load.quantity, given, pad), _miss(load, given, pad)):
        if odd:
            yield part.finding("warning", f"{said} {odd}.", load.quantity)


def _pull(quantity: str, value: np.ndarray) -> str:
    if quantity == "pressure":
        return "is suction: a pressure that compresses is above 0" if value[0] < 0 else ""
    return "pulls at the pad: compression is negative along z" if value[2] > 0 else ""


def _miss(load: Load, value: np.ndarray, pad: UndeformedPad) -> str:
    """A message if an indenter never touches a pad's top on its way."""
    if load.moved_indenter is None or not isinstance(pad.pad, Pad) or value[2] > 0:
        return ""
    half = np.array(pad.pad.extent[:2]) / 2
    at, top = np.array(load.moved_indenter.at), np.linspace(-1, 1, PLACES_LOOKED_AT)
    depths = value[2] * 0.5 ** np.arange(12)  # on its way: a ball that has been pushed in whole is below the top
    for share, depth in product((0.0, 1.0), depths):  # pushed down, and moved sideways
        tip = [*(at + share * value[:2]), depth]
        places = np.stack(np.meshgrid(*(np.append(top, near) for near in np.clip(tip[:2] / half, -1, 1))), axis=-1)
        places = np.concatenate([places.reshape(-1, 2) * half, np.zeros((places[..., 0].size, 1))], axis=1)
        if load.moved_indenter.body.gap(places - tip).size.min() < 0:
            return ""
    return "leaves the pad at rest: the indenter does not touch it"


def _size(quantity: str, value: np.ndarray, pad: UndeformedPad) -> str:
    if not isinstance(pad.pad, Pad):
        return ""
    x, y, z = pad.pad.extent
    size = math.hypot(*value)
    if quantity == "displacement":
        return f"is more than the height of the pad, {z:g} mm; if it is in µm, write it in mm" if size >= z else ""
    modulus = pad.material.youngs_modulus
    if doubt(specifications()[PAD].values()["youngs_modulus"], modulus):  # then the load cannot be judged
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
