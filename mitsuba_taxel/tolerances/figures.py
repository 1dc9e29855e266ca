"""Figures of a sensor for tolerance studies: reading at rest, sensitivity, noise as a force, cross-talk."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Noise = Callable[[np.ndarray], np.ndarray]
"""Standard deviation of the noise of readings."""


def figures(
    readings: np.ndarray, force: np.ndarray, loaded: int | None = None, noise: Noise | None = None
) -> dict[str, np.ndarray]:
    """Figures of readings (..., forces, taxels), each (..., taxels).

    ``rest``: at the least force. ``sensitivity``: mean slope from there to the largest force. ``noise_force``: the
    noise at the least force over that slope, if the ``noise`` is known. ``crosstalk``: the change in between, relative
    to the reading at rest, over that of the taxel ``loaded`` (an index), for which it is NaN; only for several taxels.
    """
    first, last = np.abs(force).argmin(), np.abs(force).argmax()
    rest = readings[..., first, :]
    found = {"rest": rest}
    if force[first] != force[last]:
        change = readings[..., last, :] - rest
        found["sensitivity"] = slope = change / (force[last] - force[first])
        if noise is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                found["noise_force"] = noise(rest) / np.abs(slope)
        if readings.shape[-1] > 1 and loaded is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                share = change / rest
                crosstalk = share / share[..., loaded, None]
            crosstalk[..., loaded] = np.nan
            found["crosstalk"] = crosstalk
    return found


def loaded_taxel(readings: np.ndarray, force: np.ndarray) -> int:
    """Index of the taxel whose reading (forces, taxels) changes most, relative to that at rest."""
    first, last = np.abs(force).argmin(), np.abs(force).argmax()
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(readings[last] / readings[first] - 1)
    return int(np.nan_to_num(change, posinf=0.0).argmax())


def figure_rates(
    readings: np.ndarray, rates: np.ndarray, force: np.ndarray, loaded: int | None, noise: Noise | None = None
) -> dict[str, np.ndarray]:
    """Derivatives (taxels, parameters) of the figures, from readings (forces, taxels) and their derivatives (forces,
    taxels, parameters)."""
    largest = np.nanmax(np.abs(rates), initial=0.0)
    step = 1e-4 * np.abs(readings).max() / (largest if largest > 0 else 1.0)
    both = (readings + sign * step * np.moveaxis(rates, -1, 0) for sign in (1.0, -1.0))
    moved = [figures(one, force, loaded, noise) for one in both]
    return {name: (moved[0][name] - moved[1][name]).T / (2 * step) for name in moved[0]}
