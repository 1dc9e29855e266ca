"""Memory of a viscoelastic pad, added step by step to the readings and forces of a model without memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import floats_of, is_number, is_whole, refusal, shape_words
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.creep import CreepResponse
from mitsuba_taxel.mechanics.materials.viscoelastic import Terms, checked_terms, prony_of


class PadMemory:
    """Memory of the silicone of B pads, as a Prony series: creep of readings, or relaxation of forces.

    The silicone is taken as linear and incompressible, with the contact that it has at the time. Under given forces,
    readings then follow the integral of the creep function over the changes of the force. Under given depths, the shape
    of the pad, and with it the readings, have no memory, and forces follow the integral of the relaxation function (J.
    D. Ferry, Viscoelastic Properties of Polymers, 1980, chapter 3). Values change linearly within a step, for which the
    integrals are exact. Where bodies retreat faster than the silicone recovers, the real contact is smaller.

    Parameters
    ----------
    prony : str or sequence of (float, float)
        Terms "weight time" of the Prony series, as in a scene, or pairs: the fraction of the stress that relaxes, and
        its relaxation time in s. The model is that of the pad without `prony`, whose stiffness is the instantaneous
        one.
    under : str
        ``force``: values are changes of readings from rest, in a model over forces. ``depth``: values are forces or
        moments, in a model over depths.
    pads : int
        Number B of pads.
    values : int
        Number C of values of each pad.

    Raises
    ------
    InputError
        if a value is not allowed.
    """

    def __init__(self, prony: str | Terms, under: str, pads: int, values: int) -> None:
        if under not in ("force", "depth"):
            raise refusal("under", under, "'force' or 'depth' is needed")
        for name, count in (("pads", pads), ("values", values)):
            if not (is_whole(count) and count > 0):
                raise refusal(name, count, "a whole number above 0 is needed")
        terms = checked_terms(prony_of(prony) if isinstance(prony, str) else prony)
        self._response = CreepResponse.of(terms, under == "force")
        self._last = np.zeros((pads, values))
        self._memory = self._response.at_rest(pads * values)

    def step(self, values: np.ndarray, duration: float) -> np.ndarray:
        """Readings or forces with the memory of the silicone at the end of a time step.

        Parameters
        ----------
        values : (B, C) ndarray
            Values of the model without memory at the end of the step, 0 at rest. A pad with a NaN is left as it was.
        duration : float
            Duration of the step in s; 0 for a jump.

        Returns
        -------
        (B, C) ndarray
            Values with memory; NaN for pads with a NaN.

        Raises
        ------
        InputError
            if a value is not allowed.
        """
        values, known = checked_step("values", values, self._last.shape, duration)
        held = np.where(known, values, self._last)
        after = self._response.after(self._memory, (held - self._last).ravel(), float(duration))
        self._memory = np.where(np.broadcast_to(known, held.shape).ravel(), after, self._memory)
        self._last = held
        transient = (self._response.amplitudes @ self._memory).reshape(held.shape)
        return np.where(known, self._response.lasting * held + transient, np.nan)

    def reset(self, pads: Any = slice(None)) -> None:
        """Set pads to the state at rest: the silicone forgets earlier loads.

        Parameters
        ----------
        pads : int, slice or array_like, optional
            Indices of the pads, or a mask; by default all.
        """
        pads = pads if isinstance(pads, slice) else np.asarray(pads)  # a tuple would be a place in the array
        self._last[pads] = 0.0
        self._memory.reshape(len(self._memory), *self._last.shape)[:, pads] = 0.0


def checked_step(name: str, values: Any, shape: tuple[int, ...], duration: Any) -> tuple[np.ndarray, np.ndarray]:
    """Check the values and the duration of a time step, and return them as arrays.

    Parameters
    ----------
    name : str
        Name of the values, for messages.
    values : array_like
        Values of the step.
    shape : tuple[int, ...]
        Required shape (B, C).
    duration : float
        Duration of the step in s.

    Returns
    -------
    array : (B, C) ndarray
        The values.
    known : (B, 1) ndarray of bool
        Pads whose values are all finite.

    Raises
    ------
    InputError
        if the values have another shape, or the duration is not a finite number of at least 0.
    """
    if not (is_number(duration) and duration >= 0):
        raise refusal("duration", duration, "a number of at least 0 s is needed")
    array = floats_of(values)
    if array.shape != shape:
        raise InputError(f"{name} {shape_words(values)} is not allowed: an array {shape} is needed.")
    return array, np.isfinite(array).all(axis=1, keepdims=True)
