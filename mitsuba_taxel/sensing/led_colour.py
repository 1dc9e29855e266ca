"""Colours of LEDs as a camera sees them: spectra as triples of red, green and blue."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError


def led_colour(spectrum: np.ndarray, sensitivity: np.ndarray) -> np.ndarray:
    """Signals of the red, green and blue pixels of a camera under the light of an LED.

    A signal is the mean of the sensitivity of these pixels, weighted by the power of the LED at each wavelength:
    radiance of the LED times the triple is what the camera records. Both curves are linear between their rows; the
    sensitivity is 0 outside its rows. Silicone, coat and window are taken to have the same index and reflectance at all
    wavelengths of one LED.

    Parameters
    ----------
    spectrum : (N, 2) ndarray
        Rows of wavelength in nm, rising, and power of the LED per nm, in any unit. The LED is dark outside its rows.
    sensitivity : (M, 4) ndarray
        Rows of wavelength in nm, rising, and sensitivity of red, green and blue pixels, relative to the power of the
        light.

    Returns
    -------
    (3,) ndarray
        Red, green and blue, in the unit of the sensitivity.

    Raises
    ------
    InputError
        if a table has another shape, values that are negative or not finite, or wavelengths that do not rise; or if the
        LED is dark, or has more than 1 % of its power beyond the rows of the sensitivity.
    """
    led, camera = (
        _table(*of)
        for of in (("spectrum", spectrum, ("power",)), ("sensitivity", sensitivity, ("red", "green", "blue")))
    )
    nm = np.union1d(led[:, 0], camera[:, 0])
    middle = 0.5 * (nm[1:] + nm[:-1])
    # Simpson's rule is exact: between two wavelengths, the product of the curves is a parabola.
    power = [np.interp(at, led[:, 0], led[:, 1], left=0, right=0) for at in (nm[:-1], middle, nm[1:])]
    weights = np.diff(nm) / 6 * np.array([1, 4, 1])[:, None] * np.array(power)
    # Sensitivities just inside and outside their first and last row differ.
    inside = (middle > camera[0, 0]) & (middle < camera[-1, 0])
    # So do the powers of the LED.
    weights *= (middle > led[0, 0]) & (middle < led[-1, 0])
    total = weights.sum()
    if total == 0:
        raise InputError("spectrum is not allowed: its power is 0 at all wavelengths.")
    if weights[:, ~inside].sum() > 0.01 * total:
        raise InputError(
            f"sensitivity is not allowed: its rows from {camera[0, 0]:g} to {camera[-1, 0]:g} nm leave out "
            f"{weights[:, ~inside].sum() / total:.0%} of the power of the LED."
        )
    weights[:, ~inside] = 0
    signals = [
        sum(w @ np.interp(at, camera[:, 0], column) for w, at in zip(weights, (nm[:-1], middle, nm[1:]), strict=True))
        for column in camera[:, 1:].T
    ]
    return np.array(signals) / total


def _table(name: str, table: np.ndarray, columns: tuple[str, ...]) -> np.ndarray:
    """A table as an array of numbers; raises `InputError`."""
    words = f"{name} is not allowed: rows of wavelength in nm, rising, and {', '.join(columns)}"
    try:
        rows = np.asarray(table, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{words} are needed.") from error
    if rows.ndim != 2 or rows.shape[1] != 1 + len(columns) or len(rows) < 2 or not (np.diff(rows[:, 0]) > 0).all():
        raise InputError(f"{words} are needed, at least two.")
    if not (np.isfinite(rows).all() and (rows >= 0).all()):
        raise InputError(f"{words} are needed, all finite and at least 0.")
    return rows
