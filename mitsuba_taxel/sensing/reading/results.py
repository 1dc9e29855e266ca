"""Definitions of all results of a reading, such as powers and errors.

An entry states the name, unit and meaning of a result, and how it is computed from `Readings`. Datasets of studies,
NetCDF, CSV and Parquet tables, the list of names that parameters may not have, and the table in the documentation are
made from these entries. Results of deformed pads are defined in `mitsuba_taxel.sensing.reading.pad_results`, and are
included automatically.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.sensing.reading.pad_results import (
    PAD_RESULTS,
    PLATE_RESULTS,
    REACTION_RESULTS,
    PadResult,
    ReactionResult,
)
from mitsuba_taxel.sensing.reading.readings import Readings

TAXEL, PARAMETER = "taxel", "parameter"


class Result(NamedTuple):
    """Definition of a result of a reading.

    Attributes
    ----------
    name, unit, meaning : str
        Name, unit and meaning. The unit is 1 for none, and empty if it follows from the parameter of a derivative.
    per : tuple[str, ...]
        Dimensions of the result in addition to those of a study: taxel, parameter or both; empty for one number for
        each scene.
    of : Callable[[Readings], array or None]
        Returns the values of the result for a reading; None if the reading lacks this result.
    along_curve : bool
        Whether a study computes the result for some scenes of a curve only and interpolates between them, as with
        errors from a second mesh.
    in_table : bool
        Whether tables of readings contain the result.
    """

    name: str
    unit: str
    meaning: str
    per: tuple[str, ...]
    of: Callable[[Readings], Any]
    along_curve: bool = False
    in_table: bool = True


def _of_derivatives(attribute: str) -> Callable[[Readings], Any]:
    return lambda readings: None if readings.derivatives is None else getattr(readings.derivatives, attribute)


def _methods(readings: Readings) -> list[str] | None:
    derivatives = readings.derivatives
    if derivatives is None:
        return None
    # A column without values: the study fits curves through its readings instead.
    return ["" if unknown else derivatives.method for unknown in np.isnan(derivatives.values).all(axis=0)]


def _worst_roof(attribute: str) -> Callable[[Readings], float | None]:
    def of(readings: Readings) -> float | None:
        if readings.roof_errors:
            return max(math.nan if error is None else getattr(error, attribute) for error in readings.roof_errors)
        at_rest = readings.pads and not any(estimate.value or estimate.error for estimate in readings.pads.values())
        return 0.0 if at_rest else None

    return of


def _of_pads(name: str, attribute: str) -> Callable[[Readings], float | None]:
    return lambda readings: None if name not in readings.pads else getattr(readings.pads[name], attribute)


def _contact_rates(readings: Readings) -> Any:
    return None if readings.contact is None or not len(readings.contact.rates) else readings.contact.rates


_ALL_OF_PADS: tuple[PadResult | ReactionResult, ...] = (*PAD_RESULTS, *PLATE_RESULTS, *REACTION_RESULTS)

RESULTS: tuple[Result, ...] = (
    Result("power", "W", "optical power", (TAXEL,), lambda readings: readings.power),
    Result("standard_error", "W", "1 sigma of power (light)", (TAXEL,), lambda readings: readings.standard_error),
    Result(
        "mechanics_error",
        "W",
        "1 sigma of power (finite elements)",
        (TAXEL,),
        lambda readings: readings.mechanics_error,
    ),
    Result(
        "geometry_error",
        "W",
        "1 sigma of power (flat triangles of curved walls)",
        (TAXEL,),
        lambda readings: readings.geometry_error,
    ),
    Result(
        "total_error",
        "W",
        "error of power (light, mechanics and geometry)",
        (TAXEL,),
        lambda readings: readings.total_error,
    ),
    Result(
        "deviation",
        "W",
        "change of power with the roofs of coarser finite elements",
        (TAXEL,),
        lambda readings: readings.deviation,
        in_table=False,
    ),
    Result(
        "roof_error",
        "mm",
        "finite-element error of the roofs' displacement, root mean square",
        (),
        _worst_roof("displacement"),
    ),
    Result(
        "slope_error",
        "degrees",
        "finite-element error of the roofs' slope, root mean square",
        (),
        _worst_roof("slope"),
    ),
    *(
        entry
        for result in _ALL_OF_PADS
        for entry in (
            Result(result.name, result.unit, result.meaning, (), _of_pads(result.name, "value")),
            Result(
                f"{result.name}_error",
                result.unit,
                f"1 sigma of {result.name} (finite elements)",
                (),
                _of_pads(result.name, "error"),
                along_curve=True,
            ),
        )
    ),
    Result(
        "smooth_power",
        "W",
        "optical power by the method of the derivatives",
        (TAXEL,),
        _of_derivatives("power"),
        in_table=False,
    ),
    Result(
        "smooth_power_error",
        "W",
        "1 sigma of smooth_power",
        (TAXEL,),
        _of_derivatives("power_errors"),
        along_curve=True,
        in_table=False,
    ),
    Result("derivative", "", "derivative of smooth_power", (TAXEL, PARAMETER), _of_derivatives("values")),
    Result(
        "derivative_error",
        "",
        "1 sigma of derivative",
        (TAXEL, PARAMETER),
        _of_derivatives("standard_errors"),
        along_curve=True,
    ),
    Result("derivative_method", "", "how derivative was computed", (PARAMETER,), _methods),
    Result(
        "largest_strain_derivative",
        "",
        "derivative of largest_strain",
        (PARAMETER,),
        _of_derivatives("strain_rates"),
        in_table=False,
    ),
    Result("clearance", "mm", "least distance between cells and packages", (), _of_derivatives("clearance")),
    Result(
        "clearance_derivative",
        "",
        "derivative of clearance",
        (PARAMETER,),
        _of_derivatives("clearance_rates"),
        in_table=False,
    ),
    Result(
        "first_contact",
        "",
        "load at which the pad first touches anything",
        (),
        lambda readings: None if readings.contact is None else readings.contact.value,
    ),
    Result("first_contact_derivative", "", "derivative of first_contact", (PARAMETER,), _contact_rates, in_table=False),
    Result(
        "touched",
        "",
        "what the pad touches there",
        (),
        lambda readings: None if readings.contact is None else readings.contact.touched,
    ),
    Result(
        "ended",
        "",
        "why its load path ends there without contact",
        (),
        lambda readings: None if readings.contact is None else readings.contact.ended,
    ),
)
