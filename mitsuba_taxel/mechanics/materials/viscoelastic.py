"""Viscoelastic silicone: finite linear viscoelasticity of the isochoric stress.

With S the instantaneous isochoric second Piola-Kirchhoff stress of a law, that of a viscoelastic silicone is ::

    S - sum of g_i S + sum of Q_i,    dQ_i/dt + Q_i / tau_i = g_i dS/dt

(a Prony series; J. C. Simo, Comput. Methods Appl. Mech. Eng. 60, 1987; G. A. Holzapfel, Nonlinear Solid Mechanics,
2000, section 6.10). The volumetric part does not relax. Over a time step h in which S changes linearly, ::

    Q_i -> exp(-x) Q_i + g_i f(x) (change of S),    f(x) = (1 - exp(-x)) / x,    x = h / tau_i

is exact (R. L. Taylor, K. S. Pister and G. L. Goudreau, Int. J. Numer. Methods Eng. 2, 1970).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import is_number, is_row, refusal, require
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material

LONGEST = 1e30
"""Steps longer than this number of relaxation times are treated as this long."""
SHORT = 1e-2
"""Steps shorter than this number of relaxation times are expanded in a series."""

MOST_TERMS = 100
"""Of a Prony series: each keeps its stress at every point of the silicone."""
Terms = tuple[tuple[float, float], ...]
"""Shares and relaxation times in s."""


class Weights(NamedTuple):
    """Effect of a step on each term (k,): ``decay`` of Q, ``ramp`` of a linear change of S, ``curvature`` of its
    curvature.

    ``curvature`` times h² S'' is the error of a linear change where S has that second derivative.
    """

    decay: np.ndarray
    ramp: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True)
class Viscoelastic(Displayed):
    """A silicone whose stress relaxes.

    Parameters
    ----------
    law : Material
        Instantaneous law: ``youngs_modulus`` and all other constants apply to loads faster than the shortest relaxation
        time. Long after the longest, stresses are (1 - sum of g) times as large.
    prony : sequence of (float, float)
        Terms (g, tau): the share of the stress that relaxes, and its relaxation time in s.

    Raises
    ------
    InputError
        if a share or a time is not above 0, or the shares add up to 1 or more.
    """

    law: Material
    prony: Terms

    def __post_init__(self) -> None:
        require("law", self.law, Material, "a Material, such as NeoHookean,")
        object.__setattr__(self, "prony", checked_terms(self.prony))

    @property
    def shares(self) -> np.ndarray:
        """(k,) g."""
        return np.array([share for share, _ in self.prony])

    @property
    def times(self) -> np.ndarray:
        """(k,) tau in s."""
        return np.array([time for _, time in self.prony])

    def relaxation(self, time: float | np.ndarray) -> np.ndarray:
        """Fraction of the stress that remains after a step of the strain: the Prony series.

        Parameters
        ----------
        time : float or (...) ndarray
            After the step, s.

        Returns
        -------
        (...) ndarray
            From 1 at once to what the springs alone bear.
        """
        return 1 + np.expm1(-np.asarray(time, dtype=float)[..., None] / self.times) @ self.shares

    def over(self, step: float) -> Weights:
        """Effect of a step in s on each term."""
        x = np.minimum(step / self.times, LONGEST)
        series = x / 12 - x**2 / 24 + x**3 / 80
        long = np.maximum(x, SHORT)
        decay, ramp = np.exp(-x), np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1.0)
        with np.errstate(under="ignore"):
            closed = -0.5 * np.expm1(-long) / long - (1 - np.exp(-long) * (1 + long)) / long**2
        return Weights(decay, ramp, np.where(x < SHORT, series, closed))


@dataclass(frozen=True)
class Elastic(Viscoelastic):
    """An elastic silicone, as a viscoelastic one without terms: with friction, it too has a history."""

    prony: Terms = ()

    def __post_init__(self) -> None:
        """There is nothing to check."""


def checked_terms(prony: object) -> Terms:
    """The terms of a Prony series as pairs of numbers; raises `InputError`."""

    def is_pair(term: object) -> bool:
        return is_row(term, is_number) and len(term) == 2  # type: ignore[arg-type]

    if not (is_row(prony, is_pair) and len(prony)):  # type: ignore[arg-type]
        raise refusal("prony", prony, "at least one pair of numbers, a share and a relaxation time in s, is needed")
    terms: Sequence[Sequence[float]] = prony  # type: ignore[assignment]
    if len(terms) > MOST_TERMS:
        raise InputError(f"prony with {len(terms)} terms is not allowed: at most {MOST_TERMS} are.")
    for share, time in terms:
        if not (share > 0 and time > 0):
            raise InputError(f"prony term {share:g} {time:g} is not allowed: a share and a time above 0 are needed.")
    total = sum(share for share, _ in terms)
    if not total < 1:
        raise InputError(
            f"prony shares that add up to {total:g} are not allowed: less than 1 is needed, or no stiffness remains."
        )
    return tuple((float(share), float(time)) for share, time in terms)


def prony_of(text: str) -> Terms:
    """The terms of a Prony series from a text such as ``0.2 1; 0.1 10``.

    Parameters
    ----------
    text : str
        Weights, relative to the stress at once, and relaxation times in s.

    Returns
    -------
    tuple[tuple[float, float], ...]
        None if the text is blank.

    Raises
    ------
    InputError
        if a term is not allowed.
    """
    if not text.strip():
        return ()
    try:
        terms = [tuple(float(word) for word in term.split()) for term in text.strip().strip(";").split(";")]
    except ValueError:
        terms = []
    if not terms or any(len(term) != 2 for term in terms):
        raise InputError(f"prony = {text!r} is not allowed: terms 'share time', separated by ';', are needed.")
    return checked_terms(terms)
