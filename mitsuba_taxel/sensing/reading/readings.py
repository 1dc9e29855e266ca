"""Readings of phototransistors, with their errors and cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE, FACETS_SHARE
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.files.text_table import text_table
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.base.units import in_percent
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives, derivatives_text
from mitsuba_taxel.sensing.reading.finish_notes import finish_notes
from mitsuba_taxel.sensing.reading.stretch_notes import stretch_notes
from mitsuba_taxel.sensing.reading.wording import budget_line, stage_line

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import RoofError
    from mitsuba_taxel.sensing.reading.contact_value import FirstContact
    from mitsuba_taxel.sensing.reading.pad_results import Estimate


def mechanics_share(deviation: np.ndarray, power: np.ndarray) -> float:
    """Relative error of readings due to the finite elements.

    Parameters
    ----------
    deviation : (T,) ndarray
        Readings on elements of twice the size minus readings, W, for each of T taxels.
    power : (T,) ndarray
        Readings, W.

    Returns
    -------
    float
        Relative error of all readings, one standard deviation.
    """
    return ERROR_SHARE * _mean_share(deviation, power)


def geometry_share(facets: np.ndarray, power: np.ndarray) -> float:
    """Relative error of readings due to the facets (flat triangles) of curved walls.

    Parameters
    ----------
    facets : (T,) ndarray
        Change in W of the reading of each of T taxels when walls are replaced by triangles whose corners lie on them.
    power : (T,) ndarray
        Readings, W.

    Returns
    -------
    float
        Relative error of all readings, one standard deviation.
    """
    return FACETS_SHARE * _mean_share(facets, power)


def _mean_share(change: np.ndarray, power: np.ndarray) -> float:
    """Root mean square of the relative changes of all readings that are not 0."""
    lit = power > 0
    return math.sqrt(np.mean((change[lit] / power[lit]) ** 2)) if lit.any() else 0.0


def largest_share(error: np.ndarray, power: np.ndarray) -> float:
    """Largest ratio of an error to its power. For a power of 0, the ratio is 0 if the error is 0, else infinite."""
    return float(np.max(shares(error, power), initial=0.0))


def shares(error: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Each error divided by its power. For a power of 0, the ratio is 0 if the error is 0, else infinite.

    Parameters
    ----------
    error : ndarray
        Errors in W, of any shape.
    power : ndarray
        Powers in W, of the same shape.

    Returns
    -------
    ndarray
        Ratios, without unit.
    """
    return np.divide(error, power, out=np.where(error == 0, 0.0, math.inf), where=power > 0)


def or_dark(error: np.ndarray, power: np.ndarray, dark_error: np.ndarray | None) -> np.ndarray:
    """Replace the errors of readings of 0: ``dark_error`` where the power is 0, elsewhere the error from the scatter of
    the replicates."""
    return error if dark_error is None else np.where(power > 0, error, dark_error)


def error_budget(power: np.ndarray, light: np.ndarray, mechanics: np.ndarray, geometry: np.ndarray) -> dict[str, float]:
    """Error budget of readings: the largest relative error due to each source, and the largest total error.

    Parameters
    ----------
    power : (T,) ndarray
        Readings, W.
    light, mechanics, geometry : (T,) ndarray
        Errors of the readings due to each source, one standard deviation, W.

    Returns
    -------
    dict[str, float]
        Largest relative error of any taxel, with the keys ``light``, ``mechanics``, ``geometry`` and ``total``.
    """
    total = np.hypot(np.hypot(light, mechanics), geometry)
    errors = {"light": light, "mechanics": mechanics, "geometry": geometry, "total": total}
    return {name: largest_share(error, power) for name, error in errors.items()}


@dataclass(frozen=True)
class Readings(Displayed):
    """Readings of the T phototransistors of a scene: optical powers, with their errors and cost.

    Attributes
    ----------
    replicates : (R, T) ndarray
        Power in W, for each of R independent randomisations and each of T taxels.
    points : int
        Number of light paths for each taxel and replicate. It is 0 for light without random numbers, where all
        replicates are equal.
    seed : int
        Seed of the random numbers.
    seconds : dict[str, float]
        Computing time of each stage, such as ``mechanics`` and ``optics``, in s.
    parameters : dict[str, str]
        Values of the scene's parameters.
    irradiance : (height, width) ndarray or None
        Irradiance over the phototransistors in W/mm², one block of pixels for each taxel; None if not requested.
    responsivity : (T,) ndarray or None
        Photocurrent per optical power of each phototransistor at the wavelength of its LED, in A/W; None if LEDs and
        phototransistors cannot be paired.
    deviation : (T,) ndarray or None
        Change of the power, in W, if the loaded pads have the shape that coarser finite elements give. NaN if unknown.
        None if no pad is loaded or the error of the mechanics was not requested; the stated errors are then those of
        the light alone.
    dark_error : (T,) ndarray or None
        Error, in W, of a reading of 0: the power that the taxel may receive although no light path reached it, as one
        standard deviation. NaN if unknown; None if no reading is 0, or light was computed without random numbers.
    facets : (T,) ndarray or None
        Change of the power, in W, if the triangles of curved walls are inscribed; 0 if all walls are flat. The error
        due to facets is ``FACETS_SHARE`` times this change. Light without random numbers has no facets; there it is
        the error due to patches, divided by ``FACETS_SHARE``. None if not requested.
    mesh_size : float or None
        Size in mm of the finite elements of pads whose mesh the scene does not fix; None for the default.
    derivatives : Derivatives or None
        Derivatives with respect to the requested parameters.
    contact : FirstContact or None
        First contact of the pad with itself, the board or a package under an increasing load; None if not requested.
    roof_errors : list[RoofError | None]
        Finite-element error of the roofs of each loaded pad, None if unknown; empty if not requested.
    pads : dict[str, Estimate]
        Further results of deformed pads, such as the largest strain, with their errors, by name (see `PAD_RESULTS`);
        empty without a pad.
    remarks : list of str
        Further notes for the reader.
    exceeded_limits : dict[str, float]
        Largest stretch, by the description of each limit that it exceeds, such as the largest stretch at which the
        silicone was tested; empty if no limit is exceeded.
    finishes : dict[str, str]
        Finish (texture) of the cells' walls with its parameters, by the name of the wall, such as ``roof and side``.
    positions : (T, 2) ndarray or None
        Centres of the phototransistors along x and y of the first of their boards, in mm; None if unknown.
    """

    replicates: np.ndarray
    points: int
    seed: int
    seconds: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, str] = field(default_factory=dict)
    irradiance: np.ndarray | None = None
    responsivity: np.ndarray | None = None
    deviation: np.ndarray | None = None
    dark_error: np.ndarray | None = None
    facets: np.ndarray | None = None
    mesh_size: float | None = None
    derivatives: Derivatives | None = None
    contact: FirstContact | None = None
    roof_errors: list[RoofError | None] = field(default_factory=list)
    pads: dict[str, Estimate] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    exceeded_limits: dict[str, float] = field(default_factory=dict)
    finishes: dict[str, str] = field(default_factory=dict)
    positions: np.ndarray | None = None

    def __str__(self) -> str:
        return readings_text(self)

    @property
    def notes(self) -> list[str]:
        """Notes on how the readings were obtained, for the user."""
        own = [*self.remarks, *finish_notes(self.finishes), *stretch_notes(self.exceeded_limits)]
        return [*own, *describe_mechanics(self.roof_errors)]

    @property
    def taxel(self) -> np.ndarray:
        """Numbers (T,) of the taxels, from 1."""
        return np.arange(1, self.replicates.shape[1] + 1)

    @property
    def power(self) -> np.ndarray:
        """Optical power (T,) in W."""
        return self.replicates.mean(axis=0)

    @property
    def standard_error(self) -> np.ndarray:
        """Standard error (T,) of :attr:`power` due to the light, in W, from the scatter of the replicates.

        For a taxel whose replicates are all 0, it is the :attr:`dark_error`.
        """
        return or_dark(standard_error(self.replicates), self.power, self.dark_error)

    @property
    def mechanics_error(self) -> np.ndarray:
        """One standard deviation (T,) in W of :attr:`power` due to the finite elements.

        It is the same fraction of every reading that is not 0. The fraction follows from the mean square of the
        relative :attr:`deviation` of all readings, because two irregular meshes may agree by chance in a single cell.
        """
        if self.deviation is None:
            return np.zeros(len(self.taxel))
        of_lit = self.power * mechanics_share(self.deviation, self.power)
        return np.where(self.power > 0, of_lit, ERROR_SHARE * np.abs(self.deviation))

    @property
    def geometry_error(self) -> np.ndarray:
        """One standard deviation (T,) in W of :attr:`power` due to the flat triangles of curved walls. Without random
        numbers, that due to the discretisation of the light.

        It is the same fraction of every reading, like the :attr:`mechanics_error`.
        """
        if self.facets is None:
            return np.zeros(len(self.taxel))
        return self.power * geometry_share(self.facets, self.power)

    @property
    def total_error(self) -> np.ndarray:
        """Total error (T,) in W: root of the sum of the squares of the errors of light, mechanics and geometry."""
        return np.hypot(np.hypot(self.standard_error, self.mechanics_error), self.geometry_error)

    @property
    def photocurrent(self) -> np.ndarray | None:
        """Current (T,) of each phototransistor, in A; None if the responsivity is unknown."""
        return None if self.responsivity is None else self.power * self.responsivity

    @property
    def relative_error(self) -> float:
        """Largest relative standard error of any taxel; infinite if no light was found on a taxel that may receive
        some."""
        return largest_share(self.standard_error, self.power)

    @property
    def relative_total_error(self) -> float:
        """Largest relative total error of any taxel. It is infinite if no light was found on a taxel that may receive
        some.
        """
        return largest_share(self.total_error, self.power)

    @property
    def error_budget(self) -> dict[str, float]:
        """Largest relative error of any taxel due to each source, and in total; see :func:`error_budget`."""
        return error_budget(self.power, self.standard_error, self.mechanics_error, self.geometry_error)


@dataclass(frozen=True)
class Crosstalk:
    """Power that each of T LEDs alone brings to each of T phototransistors.

    Attributes
    ----------
    replicates : (R, T, T) ndarray
        Power in W, for each of R independent randomisations, each LED and each phototransistor.
    points : int
        Number of light paths for each LED and replicate.
    seed : int
        Seed of the random numbers.
    dark_error : (T, T) ndarray or None
        Error, in W, of a power of 0, as one standard deviation; NaN or None as in `Readings`.
    deviation : (T, T) ndarray or None
        Change of the power in W on coarser finite elements; see `Readings`. NaN if unknown; None if no pad is loaded.
    """

    replicates: np.ndarray
    points: int
    seed: int
    dark_error: np.ndarray | None = None
    deviation: np.ndarray | None = None

    def __str__(self) -> str:
        return crosstalk_text(self)

    @property
    def power(self) -> np.ndarray:
        """Optical power (T, T) in W: a row for each LED, a column for each phototransistor."""
        return self.replicates.mean(axis=0)

    @property
    def standard_error(self) -> np.ndarray:
        """One standard deviation (T, T) of :attr:`power` due to the light, in W."""
        return or_dark(standard_error(self.replicates), self.power, self.dark_error)

    @property
    def mechanics_error(self) -> np.ndarray:
        """Standard deviation (T, T) of :attr:`power` due to the finite elements, in W; NaN if unknown.

        All pairs of a phototransistor with its own LED have the same relative error, and so do all other pairs, because
        two meshes may agree by chance in a single pair.
        """
        power, error = self.power, np.zeros_like(self.power)
        if self.deviation is None:
            return error
        own = np.eye(len(power), dtype=bool)
        for which in (own, ~own):
            total = np.linalg.norm(power[which])
            relative = np.linalg.norm(self.deviation[which]) / total if total > 0 else 0.0
            error[which] = ERROR_SHARE * relative * power[which]
        return error

    @property
    def total_error(self) -> np.ndarray:
        """Total error (T, T) in W: root of the sum of squares of the errors due to light and mechanics. The error due
        to facets is not included."""
        return np.hypot(self.standard_error, self.mechanics_error)


def describe_mechanics(errors: Sequence[RoofError | None]) -> list[str]:
    """Describe the largest finite-element error of any loaded pad in words.

    Parameters
    ----------
    errors : sequence of (RoofError or None)
        Error of each loaded pad; None if unknown.

    Returns
    -------
    list[str]
        Lines of text; empty without a loaded pad.
    """
    if not errors:
        return []
    estimates = [error for error in errors if error is not None]
    if len(estimates) < len(errors):
        return [
            "mechanics error unknown, as a second mesh does not bear the load or needs too much memory: the stated "
            "error is that of the light alone; try a smaller mesh_size or a smaller load"
        ]
    worst = max(estimates, key=lambda error: error.displacement)
    return [
        f"mechanics: error of the roofs {worst.displacement:.2g} mm (at worst {worst.largest:.2g} mm, "
        f"{worst.relative:.1%} "
        f"of the largest displacement) and {worst.slope:.2g} degrees"
    ]


def readings_text(readings: Readings, width: int | None = None) -> str:
    """Readings as text: a first line with powers and error, a table by taxel, notes on the methods, and derivatives.

    Parameters
    ----------
    readings : Readings
        Readings of a scene.
    width : int, optional
        Width of a line in characters, as for `text_table`.

    Returns
    -------
    str
        Lines of text.
    """
    columns = readings_columns(readings)
    lines = [
        readings_answer(readings),
        "",
        text_table(list(columns), zip(*columns.values(), strict=True), width),
        *origin_lines(readings),
    ]
    if readings.derivatives is not None:
        lines += ["", derivatives_text(readings.derivatives, width)]
    return "\n".join(lines)


def readings_answer(readings: Readings) -> str:
    """Summarise readings in one line: the range of powers and the largest total error.

    Parameters
    ----------
    readings : Readings
        Readings of a scene.

    Returns
    -------
    str
        One line, such as ``Power on 9 phototransistors: 4.149e-03 to 4.158e-03 W, each ± 0.23 % or less.``
    """
    power, error = readings.power, readings.total_error
    count = len(power)
    if count == 1:
        answer = f"Power on the phototransistor: {power[0]:.4e}"
    else:
        answer = f"Power on {count} phototransistors: {power.min():.3e} to {power.max():.3e}"
    if not np.isfinite(error).all():
        return f"{answer} W; the error is unknown."
    if count == 1:
        share = f" ({error[0] / power[0]:.2%})" if power[0] > 0 else ""
        return f"{answer} ± {error[0]:.1e} W{share}."
    if (power <= 0).any():
        return f"{answer} W, each ± {error.max():.1e} W or less."
    return f"{answer} W, each ± {(error / power).max():.2%} or less."


def readings_columns(readings: Readings) -> dict[str, list[str]]:
    """Columns of a table with a row for each taxel: power, its errors and, if known, the photocurrent.

    Parameters
    ----------
    readings : Readings
        Readings of a scene.

    Returns
    -------
    dict[str, list[str]]
        Cells of each column, by its heading.
    """
    columns = {
        "taxel": [str(taxel) for taxel in readings.taxel],
        "power [W]": [f"{power:.6e}" for power in readings.power],
    }
    if readings.points:
        columns["light error [W]"] = [f"{error:.1e}" for error in readings.standard_error]
    if readings.deviation is not None:
        columns["mechanics error [W]"] = [f"{error:.1e}" for error in readings.mechanics_error]
    if readings.geometry_error.any():
        columns["geometry error [W]"] = [f"{error:.1e}" for error in readings.geometry_error]
    pairs = zip(readings.power, readings.total_error, strict=True)
    columns["total"] = [in_percent(error / power) if power > 0 else "-" for power, error in pairs]
    if readings.photocurrent is not None:
        columns["photocurrent [A]"] = [f"{current:.6e}" for current in readings.photocurrent]
    return columns


def origin_lines(readings: Readings) -> list[str]:
    """Describe how readings were obtained: method of the light, notes, error budget and computing time.

    Parameters
    ----------
    readings : Readings
        Readings of a scene.

    Returns
    -------
    list[str]
        Lines below the table of readings.
    """
    return [
        light_error_line(readings),
        *readings.notes,
        budget_line(readings.error_budget),
        stage_line(readings.seconds),
    ]


def light_error_line(readings: Readings) -> str:
    """Explain what the stated error of the light is and how it was obtained.

    Parameters
    ----------
    readings : Readings
        Readings of a scene.

    Returns
    -------
    str
        One line.
    """
    if not readings.points:
        return "Light: without random numbers, as all walls are diffuse; its error is included in that of the geometry."
    runs = f"{len(readings.replicates)} randomisations of {readings.points} points per taxel"
    return f"Light error: 1 sigma, from {runs}, seed {readings.seed}."


def crosstalk_text(crosstalk: Crosstalk, width: int | None = None) -> str:
    """Crosstalk as text: a table of the power that each LED brings to each phototransistor, with its error due to light
    and finite elements.

    Parameters
    ----------
    crosstalk : Crosstalk
        Crosstalk of a scene.
    width : int, optional
        Width of a line in characters.

    Returns
    -------
    str
        A title and a table.
    """
    taxels = [str(taxel) for taxel in range(1, len(crosstalk.power) + 1)]
    errors, named = crosstalk.total_error, "standard error of light and finite elements, without facets"
    if crosstalk.deviation is None or np.isnan(errors).any():
        unknown = ", as that of the finite elements is not known" if crosstalk.deviation is not None else ""
        errors, named = crosstalk.standard_error, f"standard error of the light{unknown}"
    rows = (
        (led, *(f"{power:.3e} +- {error:.0e}" if error else f"{power:g}" for power, error in zip(*of, strict=True)))
        for led, *of in zip(taxels, crosstalk.power, errors, strict=True)
    )
    title = f"Crosstalk: power [W] from each LED (row) on each phototransistor (column), +- {named}"
    return f"{title}\n{text_table(('LED', *taxels), rows, width)}"
