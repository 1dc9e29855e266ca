"""Figures of merit of a design, each with its gradient.

A figure has components, such as the sensitivities of all taxels, the worst of which counts. They are analytic functions
of readings and dimensions, given as complex numbers whose imaginary parts are derivatives with respect to one variable:
the complex step gives the derivatives of the components to the last digit (Squire and Trapp, SIAM Review 40, 1998).
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
"""Largest range or contact that is told, relative to the last load of its line: some are not reached."""
FIRST_CONTACT, RANGE = "first_contact", "range"
TO_THE_END = (RANGE, FIRST_CONTACT)
"""Figures that depend on where pads first touch anything."""
SATURATION = "saturation"
OF_CHANGES = (
    "sensitivity", "relative_sensitivity", "nonlinearity", "cross_talk", "cross_sensitivity", "noise_equivalent_force",
    "resolution",
)  # fmt: skip
"""Figures of changes of readings, which a saturated output does not show."""
ALIKE = 1e-6
"""Sine of the angle between changes of all readings with two forces below which these cannot be told apart."""
TINY = 1e-150
"""Complex step: factor of derivatives, whose squares vanish."""


@dataclass(frozen=True, eq=False)
class Line:
    """Readings along a sequence of loads.

    Attributes
    ----------
    values : (K,) ndarray
        Values of the parameter that changes along it, such as a force in N.
    power : (K, T) ndarray of complex
        Readings in W.
    strain : (K,) ndarray of complex
        Largest strain of the silicone; NaN if unknown.
    clearance : (K,) ndarray of complex
        Least distance between cells and packages in mm; NaN if unknown.
    contact : complex
        The value at which pads first touch anything, as far as it is told; NaN if unknown.
    touched : str
        What they touch there; empty if there is no contact up to there.
    ended : str
        Why the load path ends there without contact, as where the pad becomes unstable; empty if it does not.
    """

    values: np.ndarray
    power: np.ndarray
    strain: np.ndarray
    clearance: np.ndarray
    contact: complex = np.nan
    touched: str = ""
    ended: str = ""


@dataclass(frozen=True, eq=False)
class Seen:
    """Readings and dimensions of a design, from which figures are computed.

    Attributes
    ----------
    lines : Mapping[str, Line]
        Lines of loads, by name.
    shape : Mapping[str, (N,) ndarray of complex]
        Figures of the pads alone, as named in `pads.mould.SHAPE`.
    circuit : Circuit or None
        Converts watts to volts.
    """

    lines: Mapping[str, Line]
    shape: Mapping[str, np.ndarray]
    circuit: Circuit | None

    def readings(self, line: str) -> np.ndarray:
        """(K, T) in W, or in V with a circuit: those before the converter, which go on beyond its full scale, so that a
        descent finds its way back. A constraint keeps the best design below."""
        power = self.lines[line].power
        if self.circuit is None:
            return power
        shown = respond(self.circuit, np.maximum(power.real, 0.0))
        return shown.output + 1j * np.where(power.real < 0, 0.0, shown.output_rate) * power.imag

    def slopes(self, line: str) -> np.ndarray:
        """(T,) mean slopes along a line, between its ends."""
        readings, values = self.readings(line), self.lines[line].values
        return (readings[-1] - readings[0]) / (values[-1] - values[0])

    def noise(self, line: str, stated: float | None) -> np.ndarray:
        """(K, T) one standard deviation of each reading."""
        power = self.lines[line].power
        if stated is not None:
            return np.full(power.shape, complex(stated))
        assert self.circuit is not None
        lit = np.maximum(power.real, 0.0)
        step = SMALL * lit.max()
        ends = [total_noise(self.circuit, np.maximum(lit + sign * step, 0.0)) for sign in (1, -1)]
        return total_noise(self.circuit, lit) + 1j * (ends[0] - ends[1]) / (2 * step) * power.imag


def _magnitude(values: np.ndarray) -> np.ndarray:
    return np.where(values.real < 0, -values, values)


def _both_signs(values: np.ndarray) -> np.ndarray:
    """Values and their negatives, whose maximum is the largest magnitude, but smooth in each component."""
    return np.concatenate([values.ravel(), -values.ravel()])


def sensitivity(seen: Seen, along: str) -> np.ndarray:
    """Magnitude of each taxel's mean slope."""
    return _magnitude(seen.slopes(along))


def relative_sensitivity(seen: Seen, along: str) -> np.ndarray:
    """The same over the first reading."""
    return _magnitude(seen.slopes(along) / seen.readings(along)[0])


def nonlinearity(seen: Seen, along: str) -> np.ndarray:
    """Distance of each reading from the line between the ends, over the taxel's largest change: equation 7."""
    readings, values = seen.readings(along), seen.lines[along].values
    change = readings - readings[0]
    most = np.take_along_axis(change, np.abs(change.real).argmax(axis=0)[None], axis=0)[0]
    share = (values - values[0]) / (values[-1] - values[0])
    return _both_signs(((change - share[:, None] * change[-1]) / most)[1:-1])


def cross_talk(seen: Seen, along: str, taxel: int) -> np.ndarray:
    """Relative change of each other taxel's reading over that of the loaded one."""
    readings = seen.readings(along)
    change = readings[-1] / readings[0] - 1
    return _both_signs(np.delete(change / change[taxel - 1], taxel - 1))


def cross_sensitivity(seen: Seen, along: str, by: str) -> np.ndarray:
    """Force in N along ``along`` for which 1 N along ``by`` is mistaken, if the change of all readings is matched with
    that by a force along ``along`` alone."""
    own, other = seen.slopes(along), seen.slopes(by)
    return _both_signs(np.atleast_1d(own @ other / (own @ own)))


def rest(seen: Seen, along: str) -> np.ndarray:
    """First reading of each taxel."""
    return seen.readings(along)[0]


def largest_reading(seen: Seen, along: str) -> np.ndarray:
    """All readings of all taxels."""
    return seen.readings(along).ravel()


def saturation(seen: Seen, along: str) -> np.ndarray:
    """All voltages over that at which the circuit counts as saturated."""
    assert seen.circuit is not None
    return seen.readings(along).ravel() / seen.circuit.limit


def measuring_range(seen: Seen, along: str) -> np.ndarray:
    """Magnitudes of the loads at which the pad first touches anything, if that is known, and, with a circuit, at which
    each taxel saturates; by linear interpolation of light between loads, beyond the last one as between the last
    two."""
    return np.concatenate(_ends(seen, along))


def _ends(seen: Seen, along: str) -> tuple[np.ndarray, np.ndarray]:
    """The first contact, empty if it is unknown, and magnitudes of the loads at which taxels saturate, empty without a
    circuit."""
    line, saturated = seen.lines[along], np.zeros(0)
    if seen.circuit is not None:
        saturated = _used_up(saturating_power(seen.circuit) - line.power, line.values)
    return np.zeros(0) if np.isnan(line.contact.real) else first_contact(seen, along), saturated


def clearance(seen: Seen, along: str) -> np.ndarray:
    """Least distance between cells and packages at each load."""
    return seen.lines[along].clearance


def first_contact(seen: Seen, along: str) -> np.ndarray:
    """Magnitude of the load at which the pad first touches itself, the board or a package, or its path ends before."""
    return _magnitude(np.atleast_1d(seen.lines[along].contact))


def _used_up(missing: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Magnitude of the load at which each of T columns of ``missing`` (K, T) falls to 0 along ``values`` (K,)."""
    reached = missing.real[1:] <= 0
    end = np.where(reached.any(axis=0), reached.argmax(axis=0), len(values) - 2) + 1
    column = np.arange(missing.shape[1])
    before, after = missing[end - 1, column], missing[end, column]
    closing = before.real > np.maximum(after.real, 0.0)
    share = np.where(closing, before / np.where(closing, before - after, 1.0), np.where(before.real <= 0, 0.0, np.inf))
    furthest = FURTHEST * np.abs(values).max()
    found = _magnitude(values[end - 1] + share * (values[end] - values[end - 1]))
    return np.where(found.real < furthest, found, furthest)


def noise_equivalent_force(seen: Seen, along: str, noise: float | None = None) -> np.ndarray:
    """Noise of each reading as a force, by the mean slope of its taxel."""
    return (seen.noise(along, noise) / _magnitude(seen.slopes(along))).ravel()


def resolution(seen: Seen, along: tuple[str, ...], of: tuple[str, ...] = (), noise: float | None = None) -> np.ndarray:
    """One standard deviation of each load, or of those along the lines ``of``, if all are estimated from all readings
    at once.

    They are the roots of the diagonal of the inverse Fisher information, from mean slopes and the noise of the first
    readings; NaN if these do not tell all forces.
    """
    slopes = np.stack([seen.slopes(line) / seen.noise(line, noise)[0] for line in along], axis=1)
    sizes = np.linalg.norm(slopes.real, axis=0)
    alike = slopes.real / np.where(sizes > 0, sizes, 1.0)
    told = [along.index(line) for line in of or along]
    if np.linalg.eigvalsh(alike.T @ alike)[0] < ALIKE**2:
        return np.full(len(told), np.nan + 0j)
    return np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes))[told])


def largest_strain(seen: Seen, along: str) -> np.ndarray:
    """Largest principal strain of the silicone at each load, mean over the most strained 1 % of its volume."""
    return seen.lines[along].strain


def least_wall(seen: Seen) -> np.ndarray:
    """Thicknesses between cells, around the outer ones, and above them."""
    return seen.shape["least_wall"]


def draft_angle(seen: Seen) -> np.ndarray:
    """Angles by which walls of cells lean inwards from the vertical."""
    return seen.shape["draft_angle"]


def least_radius(seen: Seen) -> np.ndarray:
    """Radii of curvature of roofs along their meridian."""
    return seen.shape["least_radius"]


def view_angle(seen: Seen) -> np.ndarray:
    """Angles between roofs and rays from the middle of the cell's opening."""
    return seen.shape["view_angle"]


@dataclass(frozen=True)
class FigureOfMerit:
    """A figure of merit that may be asked for.

    Attributes
    ----------
    components : Callable
        Function of a `Seen` and the figure's parameters.
    unit : str
        With ``{u}`` for that of readings, and ``{f}`` for that of the parameter along its lines.
    takes : tuple[str, ...]
        Parameters besides its lines.
    steps, lines : int
        Numbers of loads and lines needed; without lines, it does not depend on readings.
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
    """A figure of a study: its kind, parameters, and unit."""

    kind: str
    told: dict[str, Any]
    unit: str

    @property
    def words(self) -> str:
        """Such as ``nonlinearity along normal``."""
        along, of = self.told.get("along", ()), ", ".join(self.told.get("of", ()))
        lines = along if isinstance(along, str) else ", ".join(along)
        named = [self.kind.replace("_", " "), f"of {of}" if of else "", f"along {lines}" if lines else ""]
        return " ".join(filter(None, named))

    def components(self, seen: Seen) -> np.ndarray:
        """(N,) complex."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return FIGURES_OF_MERIT[self.kind].components(seen, **self.told)


def end_of(figure: Figure, seen: Seen) -> str:
    """What ends a range, or is touched first, in words."""
    line = seen.lines[figure.told["along"]]
    with np.errstate(invalid="ignore"):
        contact, saturated = (each.real for each in _ends(seen, figure.told["along"]))
    saturated = saturated if figure.kind == RANGE else np.zeros(0)
    end = np.concatenate([contact, saturated]).min()
    if end >= FURTHEST * np.abs(line.values).max():
        return "up to which nothing is in the way; more is not told"
    if end in contact:
        return f"where the pad touches {line.touched}" if line.touched else f"as {line.ended}"
    return f"where taxel {saturated.argmin() + 1} saturates"
