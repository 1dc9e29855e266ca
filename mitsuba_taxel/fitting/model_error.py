"""Propagation of the errors of the model's readings to the unknowns by the delta method.

The derivative of a least-squares solution with respect to the model's readings is the pseudoinverse of the weighted
Jacobian (G. A. F. Seber and C. J. Wild, Nonlinear Regression, 1989, chapter 2).
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
        Readings for each randomisation of the light; all settings share the random numbers.
    mechanics, geometry : (settings, taxels) ndarray
        Standard deviations due to the finite elements (NaN if unknown), and due to the surfaces or, without random
        numbers, to the patches of the light.
    by_reading : (unknowns, settings, taxels) ndarray
        Derivative of each unknown with respect to each of these readings, by least squares; NaN if undetermined.
    setting_of_row : (rows,) ndarray
        Index of the setting of each row of the data.
    """

    replicates: np.ndarray
    mechanics: np.ndarray
    geometry: np.ndarray
    by_reading: np.ndarray
    setting_of_row: np.ndarray

    def of_rows(self) -> np.ndarray:
        """Standard deviation of the model's readings for each row of the data, (rows, taxels); NaN if unknown."""
        light = standard_error(self.replicates)
        return np.sqrt(light**2 + self.mechanics**2 + self.geometry**2)[self.setting_of_row]


class UnknownErrors(NamedTuple):
    """Standard deviations (parameters,) of the fitted parameters, due to the light, the finite elements and the
    surfaces of the model; NaN where they are not known."""

    light: np.ndarray
    mechanics: np.ndarray
    geometry: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Root of the sum of squares of the known deviations, (unknowns,)."""
        return np.sqrt(np.nansum(np.square(self), axis=0))


def carried(error: ModelError) -> UnknownErrors:
    """Errors of the fitted unknowns due to the errors of the model's readings.

    The replicates of the light contain the covariance of its errors. For errors due to finite elements and surfaces,
    the correlation between readings is unknown. The largest deviation for any correlation is returned for them, which
    is the sum of the magnitudes of all contributions.

    Parameters
    ----------
    error : ModelError
        Errors of the readings, and derivatives of the unknowns with respect to them.

    Returns
    -------
    UnknownErrors
        Errors due to light, finite elements and surfaces, in the units of the unknowns.
    """
    light = standard_error(np.einsum("kst,rst->rk", error.by_reading, error.replicates))
    size = np.abs(error.by_reading)
    return UnknownErrors(
        light, *(np.einsum("kst,st->k", size, deviation) for deviation in (error.mechanics, error.geometry))
    )
