"""Second-order terms of a contact model, fitted to full solutions, with the error of the model on bodies that were left
out.

Let l be the change of a reading by the linear model, relative to the reading at rest, F the force by the linear model,
d the largest depth, and r the square root of the contact area, both relative to the height of the pad. With
second-order terms, the change is l + a l^2 + b l d and the force is F (1 + c d + e r). Cross-validation chooses which
of these terms are used, and whether all taxels share a and b.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_readings import ContactModel, ContactReadings, LearntErrors, SecondOrder
from mitsuba_taxel.surrogates.contact_states import SolvedTouch

FEWEST = 4
"""Smallest number of bodies from which second-order terms are learnt: each is left out in turn."""


class _Rows(NamedTuple):
    """Data for the fit from S states of bodies: the number of the body (S,), results of the linear model, their
    features, and the full solutions."""

    body: np.ndarray
    change: np.ndarray
    features: np.ndarray
    force: np.ndarray
    force_features: np.ndarray
    full_change: np.ndarray
    full_force: np.ndarray
    full_moment: np.ndarray
    linear: ContactReadings


def with_second_order(model: ContactModel, solved: Sequence[SolvedTouch]) -> ContactModel:
    """Contact model with second-order terms that are fitted to full solutions, and with its error on left-out bodies.

    Parameters
    ----------
    model : ContactModel
        The linear model.
    solved : Sequence[SolvedTouch]
        Full solutions of bodies on the same pad.

    Returns
    -------
    ContactModel
        The model with `second`, `errors`, and the range of the centres of pressure of these states as its `places`.

    Raises
    ------
    InputError
        if there are fewer than `FEWEST` bodies, or none of them reaches the centre of a patch.
    """
    if len(solved) < FEWEST:
        raise InputError(f"{len(solved)} bodies are too few to learn from: at least {FEWEST} are needed.")
    rows = _rows(replace(model, second=None), solved)
    if not rows.force.any():
        raise InputError(
            "no body reaches the centre of a patch of the top: a smaller spacing of the patches is needed."
        )
    scale = np.abs(rows.full_change).max(axis=0)
    full_scale = float(np.abs(rows.full_force[:, 2]).max())

    # Terms of the readings: those with which bodies that were left out are predicted best.
    uses = [(first, second) for first in (False, True) for second in (False, True)]
    predicted = {
        (used, shared): _left_out(rows, partial(_reading_terms, rows, used=used, shared=shared))
        for used in uses
        for shared in (True, False)
    }
    best = min(predicted, key=lambda key: _rms((predicted[key] - rows.full_change) / scale))
    misses = (predicted[best] - rows.full_change) / scale

    # Terms of the force.
    forces = {used: _left_out_forces(rows, used) for used in uses}
    best_force = min(forces, key=lambda used: float(np.square(forces[used] - -rows.full_force[:, 2]).mean()))
    vectors = np.stack([0 * rows.force, 0 * rows.force, -forces[best_force]], axis=1)
    force_misses = np.linalg.norm(vectors - rows.full_force, axis=1) / full_scale
    # A touch between the centres of patches has neither force nor moment in the linear model.
    ratio = np.divide(forces[best_force], rows.force, out=np.zeros_like(rows.force), where=rows.force > 0)[:, None]
    moment_misses = np.linalg.norm((rows.linear.moment * ratio - rows.full_moment)[:, :2], axis=1)

    everything = np.ones(len(rows.body), dtype=bool)
    second = SecondOrder(_reading_terms(rows, everything, *best), _force_terms(rows, everything, best_force))
    errors = LearntErrors(
        bodies=len(solved),
        states=len(rows.body),
        reading_rms=_rms(misses),
        reading_worst=float(np.abs(misses).max()),
        force_rms=float(np.sqrt(np.square(force_misses).mean())),
        force_worst=float(force_misses.max()),
        moment_rms=float(np.sqrt(np.square(moment_misses).mean())),
        force_full_scale=full_scale,
    )
    # Touches that no patch sees have no centre.
    places = np.array([np.nanmin(rows.linear.centre, axis=0), np.nanmax(rows.linear.centre, axis=0)])
    return replace(model, second=second, errors=errors, places=places)


def _rows(model: ContactModel, solved: Sequence[SolvedTouch]) -> _Rows:
    maps = np.array([one.touch.below(model.points, depth) for one in solved for depth in one.touch.depths])
    linear = model(maps)
    body = np.repeat(np.arange(len(solved)), [len(one.touch.depths) for one in solved])
    change = linear.power - model.rest
    relative, deepest = change / model.rest, maps.max(axis=(1, 2)) / model.height
    features = np.stack([relative * change, deepest[:, None] * change], axis=2)
    force = -linear.force[:, 2]
    force_features = force[:, None] * np.stack([deepest, np.sqrt(linear.area) / model.height], axis=1)
    full = (np.array([row for one in solved for row in getattr(one, name)]) for name in ("power", "force", "moment"))
    power, full_force, full_moment = full
    return _Rows(
        body, change, features, force, force_features, power - model.rest, full_force, full_moment, linear
    )


def _reading_terms(rows: _Rows, kept: np.ndarray, used: tuple[bool, bool], shared: bool) -> np.ndarray:
    """Fit the coefficients (T, 2) of the second-order terms of the readings to the states selected by ``kept`` (S,)."""
    taxels, terms = rows.change.shape[1], np.flatnonzero(used)
    coefficients = np.zeros((taxels, 2))
    if not len(terms):
        return coefficients
    scale = np.abs(rows.full_change).max(axis=0)
    features = rows.features[kept][..., terms] / scale[:, None]
    missing = (rows.full_change - rows.change)[kept] / scale
    for group in [np.arange(taxels)] if shared else np.arange(taxels)[:, None]:
        matrix, values = features[:, group].reshape(-1, len(terms)), missing[:, group].ravel()
        coefficients[group[:, None], terms] = np.linalg.lstsq(matrix, values, rcond=None)[0]
    return coefficients


def _force_terms(rows: _Rows, kept: np.ndarray, used: tuple[bool, bool]) -> np.ndarray:
    """Fit the coefficients (2,) of the second-order terms of the force to the states selected by ``kept`` (S,)."""
    coefficients, terms = np.zeros(2), np.flatnonzero(used)
    if len(terms):
        missing = (-rows.full_force[:, 2] - rows.force)[kept]
        coefficients[terms] = np.linalg.lstsq(rows.force_features[kept][:, terms], missing, rcond=None)[0]
    return coefficients


def _left_out(rows: _Rows, fit: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Changes (S, T) of the readings in cross-validation: those of each body are predicted by a fit to all other
    bodies."""
    predicted = np.empty_like(rows.change)
    for number in np.unique(rows.body):
        out = rows.body == number
        predicted[out] = rows.change[out] + (rows.features[out] * fit(~out)).sum(axis=2)
    return predicted


def _left_out_forces(rows: _Rows, used: tuple[bool, bool]) -> np.ndarray:
    """Normal forces (S,) in cross-validation: those of each body are predicted by a fit to all other bodies."""
    predicted = np.empty_like(rows.force)
    for number in np.unique(rows.body):
        out = rows.body == number
        predicted[out] = rows.force[out] + rows.force_features[out] @ _force_terms(rows, ~out, used)
    return predicted


def _rms(misses: np.ndarray) -> float:
    """Root mean square error over the states, of the taxel for which it is largest."""
    return float(np.sqrt(np.square(misses).mean(axis=0)).max())
