"""Second-order terms of a contact model, fitted to full solutions, with the error of the model on bodies that were left
out.

A force F becomes F' = F (1 + c0 + c1 d + c2 r + c3 d s). Relative to the reading at rest, the linear change l' along
these forces becomes l' (1 + b0 + b1 l' + b2 d + b3 e): d is the greatest depth and r the square root of the contact
area, both relative to the height of the pad; s is the mean square distance of the forces from the middle of the top,
relative to the square of the height; and e is F' times the mean compliance, relative to the height. The change of a
reading is quadratic in the forces, which b1 and b3 describe. Constants stand for the difference between the elements of
the full solutions and those of the linear model. Cross-validation chooses which of these terms are used, and whether
all taxels share b.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_readings import ContactModel, ContactReadings, LearntErrors, SecondOrder
from mitsuba_taxel.surrogates.contact_states import SolvedTouch

FEWEST = 4
"""Smallest number of bodies from which second-order terms are learnt: each is left out in turn."""


class _Rows(NamedTuple):
    """Data to which the second-order terms are fitted, for S states.

    Of the linear model: the number of the body (S,), its results, forces (S, M), greatest depths (S,) in mm, and
    features of the force (S, 4). Of the full solutions: changes of readings in W, forces in N, and moments in N mm.
    """

    body: np.ndarray
    linear: ContactReadings
    forces: np.ndarray
    deepest: np.ndarray
    force_features: np.ndarray
    full_change: np.ndarray
    full_force: np.ndarray
    full_moment: np.ndarray

    @property
    def force(self) -> np.ndarray:
        """Normal forces (S,) of the linear model in N."""
        return self.forces.sum(axis=1)


def with_second_order(model: ContactModel, solved: Sequence[SolvedTouch]) -> ContactModel:
    """Add second-order terms to a contact model, fitted to full solutions, and its error on bodies left out of the fit.

    Parameters
    ----------
    model : ContactModel
        The linear model.
    solved : Sequence[SolvedTouch]
        Full solutions of bodies on the same pad.

    Returns
    -------
    ContactModel
        The model with `second`, `errors`, and the range of the centres of pressure of these states as its `places`;
        `second` has the largest features of their contact.

    Raises
    ------
    InputError
        if there are fewer than `FEWEST` bodies, or none of them reaches the centre of a patch.
    """
    if len(solved) < FEWEST:
        raise InputError(f"{len(solved)} bodies are too few to learn from: at least {FEWEST} are needed.")
    model = replace(model, second=None)
    rows = _rows(model, solved)
    if not rows.force.any():
        raise InputError(
            "no body reaches the centre of a patch of the top: a smaller spacing of the patches is needed."
        )
    scale = np.abs(rows.full_change).max(axis=0)
    full_scale = float(np.abs(rows.full_force[:, 2]).max())

    # Terms of the force: those with which bodies that were left out are predicted best.
    ratios = {used: _left_out(rows, partial(_ratios, rows, used)) for used in _subsets(4)}
    missing = {used: ratio * rows.force + rows.full_force[:, 2] for used, ratio in ratios.items()}
    best_force = min(missing, key=lambda used: float(np.square(missing[used]).mean()))
    ratio = ratios[best_force]
    forces, moments = _wrenches(rows, ratio, _left_out(rows, partial(_sides, rows, ratio)))
    force_misses = np.linalg.norm(forces - rows.full_force, axis=1) / full_scale
    moment_misses = np.linalg.norm((moments - rows.full_moment)[:, :2], axis=1)

    # Terms of the readings, along forces that are learnt from the same bodies.
    predicted = {
        (used, shared): _left_out(rows, partial(_changes, model, rows, best_force, used, shared))
        for used in _subsets(4)
        for shared in (True, False)
    }
    best = min(predicted, key=lambda key: _rms((predicted[key] - rows.full_change) / scale))
    misses = (predicted[best] - rows.full_change) / scale

    everything = np.ones(len(rows.body), dtype=bool)
    by_force = _force_terms(rows, best_force, everything)
    side = float(_sides(rows, 1 + rows.force_features @ by_force, everything)[0])
    largest = rows.force_features.max(axis=0)
    second = SecondOrder(_reading_terms(model, rows, by_force, *best, everything), by_force, largest, side)
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
    forces, deepest = linear.pressure[:, model.covered] * np.prod(model.size), maps.max(axis=(1, 2))
    full = (np.array([row for one in solved for row in getattr(one, name)]) for name in ("power", "force", "moment"))
    power, full_force, full_moment = full
    features = model.force_features(forces, deepest)
    return _Rows(body, linear, forces, deepest, features, power - model.rest, full_force, full_moment)


def _subsets(count: int) -> list[tuple[bool, ...]]:
    """All subsets of ``count`` terms, the smallest subsets first, as tuples that state whether each term is used."""
    return sorted(product((False, True), repeat=count), key=sum)


def _force_terms(rows: _Rows, used: tuple[bool, ...], kept: np.ndarray) -> np.ndarray:
    """Fit the coefficients (4,) of the terms of the force to the rows ``kept`` (S,)."""
    coefficients, terms = np.zeros(4), np.flatnonzero(used)
    if len(terms):
        matrix = rows.force[kept, None] * rows.force_features[kept][:, terms]
        missing = (-rows.full_force[:, 2] - rows.force)[kept]
        coefficients[terms] = np.linalg.lstsq(matrix, missing, rcond=None)[0]
    return coefficients


def _ratios(rows: _Rows, used: tuple[bool, ...], kept: np.ndarray) -> np.ndarray:
    """Ratio (S,) of the force to the force of the linear model, for all states, with terms that are fitted to the rows
    ``kept``.
    """
    return 1 + rows.force_features @ _force_terms(rows, used, kept)


def _sides(rows: _Rows, ratio: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Ratio (S,) of the tangential force to the tangential force that the slopes of the bodies give. It is the same for
    all states, and fitted to the rows ``kept``.
    """
    slopes = (ratio[:, None] * rows.linear.force[:, :2])[kept]
    square = np.square(slopes).sum()
    return np.full(len(ratio), (slopes * rows.full_force[kept, :2]).sum() / square if square > 0 else 1.0)


def _wrenches(rows: _Rows, ratio: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces and moments (S, 3), from those of the linear model: forces are multiplied by ``ratio`` (S,), and
    tangential forces by ``side`` (S,) as well.
    """
    normal = rows.linear.force * [0, 0, 1]
    upright = np.cross(np.append(np.nan_to_num(rows.linear.centre), np.zeros((len(ratio), 1)), axis=1), normal)
    force, moment = (
        (part + side[:, None] * (whole - part)) * ratio[:, None]
        for part, whole in ((normal, rows.linear.force), (upright, rows.linear.moment))
    )
    return force, moment


def _along_forces(model: ContactModel, rows: _Rows, by_force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes (S, T) of the readings in W by the linear model under forces with the terms ``by_force``, and the
    features (S, T, 4) of these changes.
    """
    forces = rows.forces * (1 + rows.force_features @ by_force)[:, None]
    change = forces @ model.gradient.T
    return change, model.reading_features(change, forces.sum(axis=1), rows.deepest)


def _reading_terms(
    model: ContactModel, rows: _Rows, by_force: np.ndarray, used: tuple[bool, ...], shared: bool, kept: np.ndarray
) -> np.ndarray:
    """Fit the coefficients (T, 4) of the terms of the readings to the rows ``kept`` (S,)."""
    change, features = _along_forces(model, rows, by_force)
    taxels, terms = change.shape[1], np.flatnonzero(used)
    coefficients = np.zeros((taxels, 4))
    if not len(terms):
        return coefficients
    scale = np.abs(rows.full_change).max(axis=0)
    matrices = (change[..., None] * features)[kept][..., terms] / scale[:, None]
    missing = (rows.full_change - change)[kept] / scale
    for group in [np.arange(taxels)] if shared else np.arange(taxels)[:, None]:
        matrix, values = matrices[:, group].reshape(-1, len(terms)), missing[:, group].ravel()
        coefficients[group[:, None], terms] = np.linalg.lstsq(matrix, values, rcond=None)[0]
    return coefficients


def _changes(
    model: ContactModel,
    rows: _Rows,
    used_force: tuple[bool, ...],
    used: tuple[bool, ...],
    shared: bool,
    kept: np.ndarray,
) -> np.ndarray:
    """Changes (S, T) of all readings in W, by terms that are fitted to the rows ``kept``."""
    by_force = _force_terms(rows, used_force, kept)
    change, features = _along_forces(model, rows, by_force)
    return change * (1 + (features * _reading_terms(model, rows, by_force, used, shared, kept)).sum(axis=2))


def _left_out(rows: _Rows, predict: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Predictions (S, ...) for the states of each body, by terms that are fitted to all other bodies."""
    predicted = None
    for number in np.unique(rows.body):
        out = rows.body == number
        values = predict(~out)
        predicted = np.empty_like(values) if predicted is None else predicted
        predicted[out] = values[out]
    assert predicted is not None
    return predicted


def _rms(misses: np.ndarray) -> float:
    """Root mean square error over all states, for the taxel with the largest one."""
    return float(np.sqrt(np.square(misses).mean(axis=0)).max())
