"""The model's own errors, carried to the unknowns by the delta method.

A small change of the model's readings moves the solution of least squares by its derivative, the pseudoinverse of the
weighted Jacobian (G. A. F. Seber and C. J. Wild, Nonlinear Regression, 1989, chapter 2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.replicates import standard_error


class ModelError(NamedTuple):
    """Errors of the model's readings at distinct settings, in the unit of the data.

    Attributes
    ----------
    replicates : (replicates, settings, taxels) ndarray
        Readings by each randomisation of the light; all settings share the random numbers.
    mechanics, geometry : (settings, taxels) ndarray
        One standard deviation by the finite elements, NaN if unknown; and by the surfaces, or, of light without random
        numbers, by its patches.
    by_reading : (unknowns, settings, taxels) ndarray
        Change of each unknown with each of these readings, by the least squares; NaN if undetermined.
    place : (rows,) ndarray
        Index of the setting of each row of the data.
    """

    replicates: np.ndarray
    mechanics: np.ndarray
    geometry: np.ndarray
    by_reading: np.ndarray
    place: np.ndarray

    def of_rows(self) -> np.ndarray:
        """(rows, taxels) one standard deviation of the readings of each row of the data; NaN if unknown."""
        light = standard_error(self.replicates)
        return np.sqrt(light**2 + self.mechanics**2 + self.geometry**2)[self.place]


class UnknownErrors(NamedTuple):
    """(unknowns,) one standard deviation of each unknown by the light, the finite elements and the surfaces of the
    model; NaN if unknown."""

    light: np.ndarray
    mechanics: np.ndarray
    geometry: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """(unknowns,) root of the sum of the squares of those that are known."""
        return np.sqrt(np.nansum(np.square(self), axis=0))


def carried(error: ModelError) -> UnknownErrors:
    """Errors of the unknowns by those of the model's readings.

    Replicates hold the covariance of the light. How errors by the finite elements and the surfaces are correlated from
    one reading to another is not known: the largest deviation that any correlation allows is stated, the sum of
    magnitudes.

    Parameters
    ----------
    error : ModelError
        Of the readings, and how the unknowns follow them.

    Returns
    -------
    UnknownErrors
        By light, finite elements and surfaces, in the units of the unknowns.
    """
    light = standard_error(np.einsum("kst,rst->rk", error.by_reading, error.replicates))
    size = np.abs(error.by_reading)
    return UnknownErrors(light, *(np.einsum("kst,st->k", size, each) for each in (error.mechanics, error.geometry)))
