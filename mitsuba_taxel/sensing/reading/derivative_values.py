"""Derivatives of the readings of all taxels with respect to parameters, with units and errors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.files.text_table import text_table

if TYPE_CHECKING:
    import xarray

DETERMINISTIC = "without random numbers"
BY_PATHS = "differences of random paths"
BY_CURVE = "curve through readings"
"""Methods; the last one is that of studies, whose readings along a force share their random numbers."""


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of the readings of T taxels with respect to P parameters.

    Attributes
    ----------
    parameters : tuple[str, ...]
        Names of the P parameters, in the order of the columns of ``values``.
    units : tuple[str, ...]
        Units of the derivatives, such as W/N.
    values : (T, P) ndarray
        Derivative of each taxel's reading with respect to each parameter, in ``units``.
    standard_errors : (T, P) ndarray
        Standard errors of ``values`` due to the light and the finite elements; NaN if unknown. The error of the light
        is due to patches of finite size and occluded light or, with random paths, to noise, the step of the difference
        and facets.
    power : (T,) ndarray
        Readings by the method of the derivatives, in W.
    power_errors : (T,) ndarray
        Standard errors of ``power`` due to the same causes, in W. With random paths, they contain the noise only,
        because the other errors are stated with the readings.
    strain : float
        Largest principal strain of the silicone (stretch - 1), averaged over the most strained hundredth of its volume.
    strain_rates : (P,) ndarray
        Derivatives of ``strain`` with respect to each parameter.
    clearance : float
        Least distance between cells and packages, in mm; NaN without packages.
    clearance_rates : (P,) ndarray
        Derivatives of ``clearance`` with respect to each parameter.
    method : str
        Method of computation: ``without random numbers``, or ``differences of random paths``.
    """

    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    standard_errors: np.ndarray
    power: np.ndarray
    power_errors: np.ndarray
    strain: float
    strain_rates: np.ndarray
    clearance: float
    clearance_rates: np.ndarray
    method: str = DETERMINISTIC

    def __str__(self) -> str:
        return derivatives_text(self)

    @property
    def taxel(self) -> np.ndarray:
        """Numbers (T,) of the taxels, from 1."""
        return np.arange(1, len(self.values) + 1)

    def to_xarray(self) -> xarray.Dataset:
        """The derivatives as a labelled dataset: ``value``, ``standard_error`` and ``unit`` by ``taxel`` and
        ``parameter``.

        Returns
        -------
        xarray.Dataset
            Dataset with the attribute ``method``.
        """
        import xarray

        dims = ("taxel", "parameter")
        return xarray.Dataset(
            {"value": (dims, self.values), "standard_error": (dims, self.standard_errors)},
            {"taxel": self.taxel, "parameter": list(self.parameters), "unit": ("parameter", list(self.units))},
            {"method": self.method},
        )

    def rows(self) -> Iterator[dict[str, Any]]:
        """Iterate over the derivatives, taxel by taxel within each parameter.

        Yields
        ------
        dict[str, Any]
            One derivative, with the keys taxel, parameter, value, standard_error, unit and method.
        """
        for parameter, unit, values, errors in zip(
            self.parameters, self.units, self.values.T, self.standard_errors.T, strict=True
        ):
            for taxel, value, error in zip(self.taxel.tolist(), values.tolist(), errors.tolist(), strict=True):
                yield {
                    "taxel": taxel,
                    "parameter": parameter,
                    "value": value,
                    "standard_error": error,
                    "unit": unit,
                    "method": self.method,
                }


def unit_of(parameter: str) -> str:
    """Unit of the derivative of a power with respect to a parameter, from the unit of the parameter.

    Parameters
    ----------
    parameter : str
        Unit of the parameter, 1 for none.

    Returns
    -------
    str
        Unit of the derivative, such as W/N.
    """
    return "W" if parameter == "1" else f"W/{parameter}"


def derivatives_text(derivatives: Derivatives, width: int | None = None) -> str:
    """Derivatives of the readings as text: a table with a row for each taxel, and each derivative with its standard
    error.

    Parameters
    ----------
    derivatives : Derivatives
        Derivatives of readings.
    width : int, optional
        Width of a line in characters.

    Returns
    -------
    str
        A title and a table.
    """
    columns = derivative_columns(derivatives)
    table = text_table(list(columns), zip(*columns.values(), strict=True), width)
    return f"Derivatives of the readings ({derivatives.method}), +- standard error\n{table}"


def derivative_columns(derivatives: Derivatives) -> dict[str, list[str]]:
    """Columns of a table with a row for each taxel: the derivative with respect to each parameter, and its standard
    error. The keys are the headings."""
    columns = {"taxel": [str(taxel) for taxel in derivatives.taxel]}
    of_parameters = zip(
        derivatives.parameters, derivatives.units, derivatives.values.T, derivatives.standard_errors.T, strict=True
    )
    for name, unit, values, errors in of_parameters:
        pairs = zip(values, errors, strict=True)
        columns[f"{name} [{unit}]"] = [
            f"{value:.4e} +- {'unknown' if math.isnan(error) else f'{error:.0e}'}" for value, error in pairs
        ]
    return columns
