"""Derivatives of the readings of all taxels, as numbers with units and errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of the readings of all taxels.

    Attributes
    ----------
    parameters : tuple[str, ...]
        Names, in the order of the columns.
    units : tuple[str, ...]
        Such as W/N.
    values : (T, P) ndarray
    standard_errors : (T, P) ndarray
        One standard deviation, due to patches of finite size, finite elements, and occluded light.
    power : (T,) ndarray
        Readings without random numbers, in W.
    power_errors : (T,) ndarray
        One standard deviation of these, due to the same causes.
    strain : float
        Largest principal strain of the silicone, stretch - 1: its mean over the most strained hundredth of the volume.
    strain_rates : (P,) ndarray
        Its derivatives.
    """

    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    standard_errors: np.ndarray
    power: np.ndarray
    power_errors: np.ndarray
    strain: float
    strain_rates: np.ndarray

    @property
    def taxel(self) -> np.ndarray:
        """(T,) numbers of the taxels, from 1."""
        return np.arange(1, len(self.values) + 1)

    def to_xarray(self) -> xarray.Dataset:
        """``value``, ``standard_error`` and ``unit`` by ``taxel`` and ``parameter``."""
        import xarray

        dims = ("taxel", "parameter")
        return xarray.Dataset(
            {"value": (dims, self.values), "standard_error": (dims, self.standard_errors)},
            {"taxel": self.taxel, "parameter": list(self.parameters), "unit": ("parameter", list(self.units))},
        )

    def rows(self) -> Iterator[dict[str, Any]]:
        """One derivative each: taxel, parameter, value, standard_error, unit."""
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
                }
