"""Derivatives of all states on a straight line of loads, by interpolation between few states.

Derivatives are smooth functions of the load, so a polynomial through the derivatives of three or four states gives
those of the other states. States are added where the error of the polynomial may be largest (F. Leja, Ann. Polon. Math.
4, 1957), until it predicts the next state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from mitsuba_taxel.base.arguments import is_row, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.derivatives.linearised_state import LinearisedState
from mitsuba_taxel.mechanics.derivatives.sensitivities import linearise

TOLERANCE = 1e-4
"""Accepted error of a polynomial at the next state, relative to the largest derivative; with that state included, it
becomes more accurate."""
FEWEST = 2
"""Number of states that are solved before the polynomial is tested."""
STRAIGHT = 1e-9
"""Tolerance of the distance of loads from a line, relative to its length."""


def rates_along(states: Sequence[State], ask: Callable[[LinearisedState], Sequence[np.ndarray]]) -> np.ndarray:
    """Derivatives of S states whose loads lie on a straight line, from the computed derivatives of few of them.

    Parameters
    ----------
    states : Sequence[State]
        States of one pad.
    ask : Callable[[LinearisedState], Sequence[ndarray]]
        Returns the derivatives of one state, all of one shape, such as ``lambda s: [s.by_value((0, 0, 1)),
        s.by_shape(v)]``.

    Returns
    -------
    (S, K, ...) ndarray
        Derivatives of each state, in the units of the requested derivatives.

    Raises
    ------
    InputError
        if states are not of one pad with loads on a line.
    ComputationError
        as :func:`linearise` does.
    """
    if not (len(states) and is_row(states, lambda state: isinstance(state, State))):
        raise refusal("states", states, "a sequence of at least one State, as load_path returns them, is needed")
    positions = _along(np.array([state.value for state in states]))
    answers: dict[int, np.ndarray] = {}
    while len(answers) < len(np.unique(positions)):
        product = np.prod([np.abs(positions - positions[index]) for index in answers], axis=0)
        chosen = int(np.argmax(product)) if answers else int(np.argmin(positions))
        predicted = _interpolated(positions, answers)[chosen] if len(answers) >= FEWEST else None
        answers[chosen] = np.array(ask(linearise(states[chosen])))
        if predicted is not None and np.all(
            _largest([answers[chosen] - predicted]) <= TOLERANCE * _largest(answers.values())
        ):
            break
    return _interpolated(positions, answers)


def _largest(answers: Iterable[np.ndarray]) -> np.ndarray:
    """Largest absolute value of each of the K derivatives over all states in ``answers``."""
    sizes = np.abs(np.array(list(answers)))
    return sizes.max(axis=(0, *range(2, sizes.ndim)))


def _along(values: np.ndarray) -> np.ndarray:
    """Distances (S,) of S loads (S, c) along the straight line through them; raises `InputError` if the loads are not
    on a line."""
    from_first = values - values[0]
    length = np.linalg.norm(from_first, axis=1).max()
    if length == 0:
        return np.zeros(len(values))
    direction = from_first[np.linalg.norm(from_first, axis=1).argmax()] / length
    positions = from_first @ direction
    if np.abs(from_first - positions[:, None] * direction).max() > STRAIGHT * length:
        raise InputError("states are not allowed: loads on one straight line are needed.")
    return positions / length


def _interpolated(places: np.ndarray, answers: dict[int, np.ndarray]) -> np.ndarray:
    """Interpolate derivatives along a line of loads: values (S, ...) at all ``places``, from a polynomial through the
    derivatives ``answers`` of some states, which are given by number."""
    nodes = places[list(answers)]
    weights = np.ones((len(places), len(nodes)))
    for k, here in enumerate(nodes):
        for node in np.delete(nodes, k):
            weights[:, k] *= (places - node) / (here - node)
    return np.tensordot(weights, np.array(list(answers.values())), axes=1)
