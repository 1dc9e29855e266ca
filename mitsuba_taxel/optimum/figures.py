"""Figures of merit of a design, with their gradients.

A figure has components, such as the sensitivities of all taxels; the worst component counts. Components are analytic
functions of readings and dimensions. Readings and dimensions are complex numbers whose imaginary parts are derivatives
with respect to one variable. The complex step gives the derivatives of the components to rounding error (Squire and
Trapp, SIAM Review 40, 1998).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.electronics import Circuit, respond, saturating_power, total_noise

SMALL = 1e-6
"""Relative step of differences of the noise, which is smooth in the power."""
FURTHEST = 10.0
"""Largest range or contact that is computed, relative to the last load of its line."""
FIRST_CONTACT, RANGE = "first_contact", "range"
TO_THE_END = (RANGE, FIRST_CONTACT)
"""Figures that depend on where pads first touch anything."""
SATURATION = "saturation"
OF_CHANGES = (
    "sensitivity", "relative_sensitivity", "nonlinearity", "cross_talk", "cross_sensitivity", "noise_equivalent_force",
    "resolution",
)  # fmt: skip
"""Figures of changes of readings, which a saturated output would hide."""
ALIKE = 1e-6
"""Sine of the angle between the changes of all readings by two forces, below which the forces are indistinguishable."""
TINY = 1e-150
"""Complex step: factor of derivatives, whose squares vanish."""


@dataclass(frozen=True, eq=False)
class LineResponse:
    """Readings of T taxels along a line of K loads.

    Attributes
    ----------
    values : (K,) ndarray
        Values of the parameter that changes along the line, such as a force in N.
    power : (K, T) ndarray of complex
        Readings in W.
    strain : (K,) ndarray of complex
        Largest strain of the silicone; NaN if unknown.
    clearance : (K,) ndarray of complex
        Least distance between cells and packages in mm; NaN if unknown.
    contact : complex
        Value of the parameter at which a pad first touches itself, the board or a package, or at which the load path
        ends, at most `FURTHEST` times the last load; NaN if unknown.
    touched : str
        Object that a pad touches at this value; empty without contact.
    ended : str
        Reason why the load path ends without contact, such as an instability; empty if it does not.
    """

    values: np.ndarray
    power: np.ndarray
    strain: np.ndarray
    clearance: np.ndarray
    contact: complex = np.nan
    touched: str = ""
    ended: str = ""


@dataclass(frozen=True, eq=False)
class DesignResponses:
    """Readings and dimensions of a design, from which its figures of merit are computed.

    Attributes
    ----------
    lines : Mapping[str, LineResponse]
        Lines of loads, by name.
    shape : Mapping[str, (N,) ndarray of complex]
        Dimensions of the pads, by the names in `pads.mould.SHAPE`.
    circuit : Circuit or None
        Read-out circuit, which converts W to V.
    """

    lines: Mapping[str, LineResponse]
    shape: Mapping[str, np.ndarray]
    circuit: Circuit | None

    def readings(self, line: str) -> np.ndarray:
        """Readings along a line, (K, T) in W, or in V with a circuit.

        Voltages are computed before the converter and may exceed its full scale, so that a descent can return from
        there. A constraint keeps the best design below the full scale.
        """
        power = self.lines[line].power
        if self.circuit is None:
            return power
        shown = respond(self.circuit, np.maximum(power.real, 0.0))
        return shown.output + 1j * np.where(power.real < 0, 0.0, shown.output_rate) * power.imag

    def slopes(self, line: str) -> np.ndarray:
        """Mean slopes of readings (T,) between the ends of a line."""
        readings, values = self.readings(line), self.lines[line].values
        return (readings[-1] - readings[0]) / (values[-1] - values[0])

    def noise(self, line: str, constant: float | None) -> np.ndarray:
        """Standard deviation of each reading, (K, T): ``constant`` in W, or by default the noise of the circuit in
        V."""
        power = self.lines[line].power
        if constant is not None:
            return np.full(power.shape, complex(constant))
        assert self.circuit is not None
        lit = np.maximum(power.real, 0.0)
        step = SMALL * lit.max()
        ends = [total_noise(self.circuit, np.maximum(lit + sign * step, 0.0)) for sign in (1, -1)]
        return total_noise(self.circuit, lit) + 1j * (ends[0] - ends[1]) / (2 * step) * power.imag


def _magnitude(values: np.ndarray) -> np.ndarray:
    """Absolute value of complex numbers that carry a derivative: the magnitude of the real part, with the derivative of
    this magnitude as imaginary part."""
    return np.where(values.real < 0, -values, values)


def _both_signs(values: np.ndarray) -> np.ndarray:
    """Append the negatives of the values. The maximum of the result is the largest magnitude, and each of its
    components is a smooth function.
    """
    return np.concatenate([values.ravel(), -values.ravel()])


def sensitivity(responses: DesignResponses, along: str) -> np.ndarray:
    """Sensitivity of each taxel, (T,): magnitude of the mean slope of its reading between the ends of a line."""
    return _magnitude(responses.slopes(along))


def relative_sensitivity(responses: DesignResponses, along: str) -> np.ndarray:
    """Relative sensitivity of each taxel, (T,): its sensitivity divided by its first reading."""
    return _magnitude(responses.slopes(along) / responses.readings(along)[0])


def nonlinearity(responses: DesignResponses, along: str) -> np.ndarray:
    """Nonlinearity: distance of each reading from the line between the ends, over the taxel's largest change.

    Equation 7 of the paper on which this program is based.
    """
    readings, values = responses.readings(along), responses.lines[along].values
    change = readings - readings[0]
    most = np.take_along_axis(change, np.abs(change.real).argmax(axis=0)[None], axis=0)[0]
    fraction = (values - values[0]) / (values[-1] - values[0])
    return _both_signs(((change - fraction[:, None] * change[-1]) / most)[1:-1])


def cross_talk(responses: DesignResponses, along: str, taxel: int) -> np.ndarray:
    """Cross-talk: relative change of the reading of each unloaded taxel, divided by that of the loaded taxel."""
    readings = responses.readings(along)
    change = readings[-1] / readings[0] - 1
    return _both_signs(np.delete(change / change[taxel - 1], taxel - 1))


def cross_sensitivity(responses: DesignResponses, along: str, by: str) -> np.ndarray:
    """Cross-sensitivity: apparent force in N along ``along`` under a force of 1 N along ``by``.

    The apparent force is the least-squares estimate from the changes of all readings, with the sensitivities to the
    force along ``along`` only.
    """
    own, disturbing = responses.slopes(along), responses.slopes(by)
    return _both_signs(np.atleast_1d(own @ disturbing / (own @ own)))


def rest(responses: DesignResponses, along: str) -> np.ndarray:
    """Reading of each taxel at the first load of a line.

    Parameters
    ----------
    responses : DesignResponses
        Responses of a design.
    along : str
        Name of the line of loads, a key of ``responses.lines``.

    Returns
    -------
    (T,) ndarray
        Readings of T taxels in W, or in V with a circuit.
    """
    return responses.readings(along)[0]


def largest_reading(responses: DesignResponses, along: str) -> np.ndarray:
    """All readings along a line (series of loads), in W, or in V with a circuit; the largest of them counts."""
    return responses.readings(along).ravel()


def saturation(responses: DesignResponses, along: str) -> np.ndarray:
    """Saturation: voltages of all taxels at all loads of the line (series of loads) named ``along``, relative to the
    voltage at which the circuit counts as saturated."""
    assert responses.circuit is not None
    return responses.readings(along).ravel() / responses.circuit.limit


def measuring_range(responses: DesignResponses, along: str) -> np.ndarray:
    """Magnitudes of the loads that limit the measuring range: at the first contact, and where each taxel saturates.

    The first contact is omitted if it is unknown; saturation is omitted without a circuit. Power is interpolated
    linearly between loads, and extrapolated linearly beyond the last load.
    """
    return np.concatenate(_ends(responses, along))


def _ends(responses: DesignResponses, along: str) -> tuple[np.ndarray, np.ndarray]:
    """Loads at which a measuring range ends: the magnitude of the load at the first contact (empty if unknown), and
    those of the loads at which each taxel saturates (empty without a circuit).
    """
    line, saturated = responses.lines[along], np.zeros(0)
    if responses.circuit is not None:
        saturated = _used_up(saturating_power(responses.circuit) - line.power, line.values)
    return np.zeros(0) if np.isnan(line.contact.real) else first_contact(responses, along), saturated


def clearance(responses: DesignResponses, along: str) -> np.ndarray:
    """Clearance, (K,): least distance between cells and packages in mm at each of K loads."""
    return responses.lines[along].clearance


def first_contact(responses: DesignResponses, along: str) -> np.ndarray:
    """Magnitude of the load at which the pad first touches itself, the board or a package, or its load path ends."""
    return _magnitude(np.atleast_1d(responses.lines[along].contact))


def _used_up(missing: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Magnitude (T,) of the load at which each column of ``missing`` (K, T) falls to 0, by linear interpolation over
    the loads ``values`` (K,).
    """
    # The first interval whose end is at or below 0, else the last interval.
    reached = missing.real[1:] <= 0
    end = np.where(reached.any(axis=0), reached.argmax(axis=0), len(values) - 2) + 1
    column = np.arange(missing.shape[1])
    before, after = missing[end - 1, column], missing[end, column]

    # Linear interpolation, or extrapolation up to the furthest load.
    closing = before.real > np.maximum(after.real, 0.0)
    fraction = np.where(
        closing, before / np.where(closing, before - after, 1.0), np.where(before.real <= 0, 0.0, np.inf)
    )
    furthest = FURTHEST * np.abs(values).max()
    loads = _magnitude(values[end - 1] + fraction * (values[end] - values[end - 1]))
    return np.where(loads.real < furthest, loads, furthest)


def noise_equivalent_force(responses: DesignResponses, along: str, noise: float | None = None) -> np.ndarray:
    """Noise-equivalent force: the noise of each reading, divided by the mean slope of its taxel."""
    return (responses.noise(along, noise) / _magnitude(responses.slopes(along))).ravel()


def resolution(
    responses: DesignResponses, along: tuple[str, ...], of: tuple[str, ...] = (), noise: float | None = None
) -> np.ndarray:
    """Resolution: standard deviation of each load ``of``, if all loads ``along`` are estimated together.

    Loads are estimated from the readings of all taxels. The resolution is the root of the diagonal of the inverse
    Fisher information, computed from mean slopes and the noise of the first readings; NaN if readings do not
    distinguish all loads. By default, ``of`` is ``along``.
    """
    slopes = np.stack([responses.slopes(line) / responses.noise(line, noise)[0] for line in along], axis=1)
    sizes = np.linalg.norm(slopes.real, axis=0)
    directions = slopes.real / np.where(sizes > 0, sizes, 1.0)
    estimated = [along.index(line) for line in of or along]
    if np.linalg.eigvalsh(directions.T @ directions)[0] < ALIKE**2:
        return np.full(len(estimated), np.nan + 0j)
    return np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes))[estimated])


def largest_strain(responses: DesignResponses, along: str) -> np.ndarray:
    """Largest principal strain of the silicone at each load, mean over the most strained 1 % of its volume."""
    return responses.lines[along].strain


def least_wall(responses: DesignResponses) -> np.ndarray:
    """Thicknesses of the silicone in mm between cells, around the outer cells, and above the cells; the least one
    counts.
    """
    return responses.shape["least_wall"]


def draft_angle(responses: DesignResponses) -> np.ndarray:
    """Angles in degrees by which the walls of cells lean inwards from the vertical, so that the pad can be removed from
    its mould.
    """
    return responses.shape["draft_angle"]


def least_radius(responses: DesignResponses) -> np.ndarray:
    """Radii of curvature of roofs along their meridian, in mm."""
    return responses.shape["least_radius"]


def view_angle(responses: DesignResponses) -> np.ndarray:
    """Angles in degrees between a roof and the rays to it from the middle of the cell's opening; below 0, the roof
    hides a part of itself.
    """
    return responses.shape["view_angle"]


@dataclass(frozen=True)
class FigureOfMerit:
    """A figure of merit that a study may request.

    Attributes
    ----------
    components : Callable
        Function of a `DesignResponses` and the figure's parameters, which returns the components (N,).
    unit : str
        Unit, with ``{u}`` for the unit of readings and ``{f}`` for the unit of the parameter along its lines.
    takes : tuple[str, ...]
        Names of its parameters in addition to lines.
    steps, lines : int
        Least numbers of loads and lines; a figure without lines does not depend on readings.
    """

    components: Callable[..., np.ndarray]
    unit: str
    takes: tuple[str, ...] = ()
    steps: int = 2
    lines: int = 1


FIGURES_OF_MERIT: dict[str, FigureOfMerit] = {
    "sensitivity": FigureOfMerit(sensitivity, "{u}/{f}"),
    "relative_sensitivity": FigureOfMerit(relative_sensitivity, "1/{f}"),
    "nonlinearity": FigureOfMerit(nonlinearity, "1", steps=3),
    "cross_talk": FigureOfMerit(cross_talk, "1", ("taxel",)),
    "cross_sensitivity": FigureOfMerit(cross_sensitivity, "1", ("by",)),
    "rest": FigureOfMerit(rest, "{u}", steps=1),
    "largest_reading": FigureOfMerit(largest_reading, "{u}", steps=1),
    SATURATION: FigureOfMerit(saturation, "1", steps=1),
    RANGE: FigureOfMerit(measuring_range, "{f}"),
    "noise_equivalent_force": FigureOfMerit(noise_equivalent_force, "{f}", ("noise",)),
    "resolution": FigureOfMerit(resolution, "{f}", ("noise", "of"), lines=2),
    "largest_strain": FigureOfMerit(largest_strain, "1", steps=1),
    FIRST_CONTACT: FigureOfMerit(first_contact, "{f}"),
    "clearance": FigureOfMerit(clearance, "mm", steps=1),
    "least_wall": FigureOfMerit(least_wall, "mm", steps=0, lines=0),
    "draft_angle": FigureOfMerit(draft_angle, "degrees", steps=0, lines=0),
    "least_radius": FigureOfMerit(least_radius, "mm", steps=0, lines=0),
    "view_angle": FigureOfMerit(view_angle, "degrees", steps=0, lines=0),
}


@dataclass(frozen=True)
class Figure:
    """A figure of merit that a study requests: its kind, parameters, and unit."""

    kind: str
    parameters: dict[str, Any]
    unit: str

    @property
    def words(self) -> str:
        """The figure in words, such as ``nonlinearity along normal``."""
        along, of = self.parameters.get("along", ()), ", ".join(self.parameters.get("of", ()))
        lines = along if isinstance(along, str) else ", ".join(along)
        named = [self.kind.replace("_", " "), f"of {of}" if of else "", f"along {lines}" if lines else ""]
        return " ".join(filter(None, named))

    def components(self, responses: DesignResponses) -> np.ndarray:
        """Components (N,) of the figure, such as one per taxel, as complex numbers: each imaginary part is `TINY` times
        the derivative with respect to a variable.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return FIGURES_OF_MERIT[self.kind].components(responses, **self.parameters)


def end_of(figure: Figure, responses: DesignResponses) -> str:
    """Describe in words what ends a measuring range or a load path: contact, an instability, or saturation."""
    line = responses.lines[figure.parameters["along"]]
    with np.errstate(invalid="ignore"):
        contact, saturated = (loads.real for loads in _ends(responses, figure.parameters["along"]))
    saturated = saturated if figure.kind == RANGE else np.zeros(0)
    end = np.concatenate([contact, saturated]).min()
    if end >= FURTHEST * np.abs(line.values).max():
        return "up to which the pad touches nothing; loads beyond were not followed"
    if end in contact:
        return f"where the pad touches {line.touched}" if line.touched else f"as {line.ended}"
    return f"where taxel {saturated.argmin() + 1} saturates"
