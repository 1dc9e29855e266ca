"""Numbers that are probably in the wrong unit (mm, N, MPa, nm and degrees are needed), and loads that miss the pad or
an effect."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, SceneObject, SceneObjects, UndeformedPad
from mitsuba_taxel.kernels.tables import RIGHT_ANGLE
from mitsuba_taxel.mechanics.elements.loads import Load, PlateWrench
from mitsuba_taxel.pads import Block, PadFile
from mitsuba_taxel.parameters import Number, Parameter, Vector
from mitsuba_taxel.specification import specifications

_OTHERS = {
    "mm": {"m": 1e3, "µm": 1e-3, "nm": 1e-6},
    "MPa": {"Pa": 1e-6, "kPa": 1e-3, "GPa": 1e3},
    "nm": {"µm": 1e3, "m": 1e9, "Å": 0.1},
}
"""Units that may be mistaken for the unit of a parameter, with their factors to it."""
LARGEST_STRAIN = 3.0
"""Largest stress on the top of a pad, relative to Young's modulus, that a pad can bear."""
CONTACT_POINTS = 41
"""Points along each side of a pad's top at which contact with an indenter is tested."""
SMALLEST_STRAIN = 2e-5
"""Smallest stress relative to Young's modulus that changes a reading visibly."""


def unusual(parameter: Parameter, value: float) -> str:
    """Explain why a value is outside the common range of its parameter; empty if it is inside.

    Parameters
    ----------
    parameter : Parameter
        The parameter, with its unit and common range.
    value : float
        Value in the unit of the parameter.

    Returns
    -------
    str
        The common range, and the value converted from another unit if that lies in the range.
    """
    lowest, highest = getattr(parameter, "common", None) or (0.0, math.inf)
    if value == 0 or not math.isfinite(value) or lowest <= abs(value) <= highest:
        return ""
    factors = _OTHERS.get(parameter.unit, {})
    likely_unit = next((unit for unit, factor in factors.items() if lowest <= abs(value) * factor <= highest), "")
    hint = f"; if it is in {likely_unit}, write {value * factors[likely_unit]:.4g}" if likely_unit else ""
    return f"{f'{lowest:g} to {highest:g} {parameter.unit}'.strip()} is common{hint}"


def check_units(objects: SceneObjects) -> Iterator[Finding]:
    """Find numbers that are probably in another unit, loads that pull or miss the pad, and missing earlier loads."""
    for obj in objects.all:
        specification = specifications()[obj.plugin].values() if obj.plugin in specifications() else {}
        for name, parameter in specification.items():
            if name in obj.props.keys():
                yield from _unusual_values(obj, parameter)
        if obj.plugin == "annular_led" and "cone_angle" in obj.props.keys():
            yield from _angle_in_radians(obj)
        if obj.plugin == PAD and obj.instance is not None:
            yield from _unusual_load(obj)
            yield from _without_earlier_load(obj)


def _unusual_values(obj: SceneObject, parameter: Parameter) -> Iterator[Finding]:
    value = obj.props[parameter.name]
    if not isinstance(parameter, Number | Vector) or isinstance(value, str | bool):
        return
    for component in np.atleast_1d(np.array(value, dtype=float)).tolist():
        reason = unusual(parameter, component)
        if reason:
            number = f"{component:g} {parameter.unit}".strip()
            message = f"{parameter.name} = {number} of {obj.plugin} is unusual: {reason}."
            yield obj.finding("warning", message, parameter.name)
            return


def _angle_in_radians(obj: SceneObject) -> Iterator[Finding]:
    angle = obj.props["cone_angle"]
    if isinstance(angle, int | float) and 0 < angle <= RIGHT_ANGLE:
        beam = f"cone_angle = {angle:g} degrees of annular_led is a narrow beam"
        hint = f"if it is in radians, write {np.degrees(angle):.4g}"
        yield obj.finding("warning", f"{beam}; {hint}.", "cone_angle")


def _unusual_load(obj: SceneObject) -> Iterator[Finding]:
    """Warn of loads that pull on the pad, that are far too large or too small for it, or that miss it."""
    pad = obj.instance
    if not np.any(pad.load[1]):
        return
    load, value = pad.load[0], np.array(pad.load[1])
    quantity = f"{load.quantity} = {', '.join(f'{component:g}' for component in value[:3])} {load.unit} of {PAD}"
    for reason in (_pull(load.quantity, value), _size(load.quantity, value, pad), _miss(load, value, pad)):
        if reason:
            yield obj.finding("warning", f"{quantity} {reason}.", load.quantity)
    if reason := _moment_size(value[3:], pad):
        moment = ", ".join(f"{component:g}" for component in value[3:])
        yield obj.finding("warning", f"moment = {moment} N mm of {PAD} {reason}.", "moment")


def _without_earlier_load(obj: SceneObject) -> Iterator[Finding]:
    """Note that Mullins' effect hardly changes the first loading, so that a scene needs earlier loads (`history`)."""
    specification = obj.instance.specification
    if specification.build_mullins() and not specification.history.strip():
        message = (
            "mullins hardly changes a first loading: history, the earlier loads, is needed, or steps with a column "
            "time."
        )
        yield obj.finding("note", message, "mullins")


def _pull(quantity: str, value: np.ndarray) -> str:
    if quantity == "pressure":
        return "is suction: a pressure that compresses is above 0" if value[0] < 0 else ""
    return "pulls at the pad: compression is negative along z" if value[2] > 0 else ""


def _miss(load: Load, value: np.ndarray, pad: UndeformedPad) -> str:
    """Message on a load that misses the pad: an indenter that touches the top nowhere on its path, or a force beside a
    tilting plate; empty otherwise."""
    if isinstance(pad.pad, PadFile):
        return ""
    if isinstance(load, PlateWrench):
        x, y = 0.5 * pad.pad.extent[0], 0.5 * pad.pad.extent[1]
        if abs(load.x) <= x and abs(load.y) <= y:
            return ""
        return (
            f"acts at load_x, load_y = {load.x:g}, {load.y:g} mm, outside of the plate, which ends at x = {x:g} and "
            f"y = {y:g} mm"
        )
    if load.moved_indenter is None or value[2] > 0:
        return ""
    if isinstance(pad.pad, Block) and pad.pad.top_radius is not None:
        return ""  # a domed top
    # Sample the path: down at its start, and down at its end. Depths halve, as a ball that is pushed in completely lies
    # below the top and seems not to touch it.
    half = np.array(pad.pad.extent[:2]) / 2
    start, top = np.array(load.moved_indenter.at), np.linspace(-1, 1, CONTACT_POINTS)
    depths = value[2] * 0.5 ** np.arange(12)
    for fraction, depth in product((0.0, 1.0), depths):
        # Test the gap to a grid on the top, which includes the point closest to the tip.
        tip = [*(start + fraction * value[:2]), depth]
        points = np.stack(
            np.meshgrid(*(np.append(top, closest) for closest in np.clip(tip[:2] / half, -1, 1))), axis=-1
        )
        points = np.concatenate([points.reshape(-1, 2) * half, np.zeros((points[..., 0].size, 1))], axis=1)
        if load.moved_indenter.body.gap(points - tip).size.min() < 0:
            return ""
    return "does not deform the pad, as the indenter does not touch it: increase the depth, or place it above the pad"


def _moment_size(moment: np.ndarray, pad: UndeformedPad) -> str:
    """A message if a moment is larger than a pad can bear, by the largest stress that it has on a level top."""
    if isinstance(pad.pad, PadFile) or not moment.any():
        return ""
    modulus, (x, y, _) = pad.material.youngs_modulus, pad.pad.extent
    if unusual(specifications()[PAD].values()["youngs_modulus"], modulus):
        return ""
    # A moment about x bends the top along y; one about z shears it, with about the stress of its arm.
    stresses = 6 * np.abs(moment) / (x * y * np.array([y, x, max(x, y)]))
    strain = float(stresses.max()) / modulus
    if strain > LARGEST_STRAIN:
        return f"is {strain:.2g} times Young's modulus at the edge of its top, which no pad bears; write it in N mm"
    return ""


def _size(quantity: str, value: np.ndarray, pad: UndeformedPad) -> str:
    if isinstance(pad.pad, PadFile):
        return ""
    x, y, z = pad.pad.extent
    size = math.hypot(*value[:3])
    if quantity == "displacement":
        return f"is more than the height of the pad, {z:g} mm; if it is in µm, write it in mm" if size >= z else ""
    modulus = pad.material.youngs_modulus
    if unusual(specifications()[PAD].values()["youngs_modulus"], modulus):  # then the load cannot be judged
        return ""
    strain = size / (1 if quantity == "pressure" else x * y) / modulus
    smaller, larger, unit = ("mN", "kN", "N") if quantity == "force" else ("Pa or kPa", "GPa", "MPa")
    if strain > LARGEST_STRAIN:
        cause = f"{strain:.2g} times Young's modulus on its top, which no pad bears"
        return f"is {cause}; if it is in {smaller}, write it in {unit}"
    if strain < SMALLEST_STRAIN and not value[3:].any():
        cause = f"{strain:.1g} of Young's modulus on its top, which changes no reading visibly"
        return f"is {cause}; if it is in {larger}, write it in {unit}"
    return ""
