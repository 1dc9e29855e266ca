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
from typing import ClassVar, NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import is_number, is_row, refusal, require
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.mullins import Mullins

LONGEST = 1e30
"""Steps longer than this number of relaxation times are treated as this long."""
SHORT = 1e-2
"""Steps shorter than this number of relaxation times are expanded in a series."""

MOST_TERMS = 100
"""Largest number of terms of a Prony series: each stores its stress at every quadrature point."""
Terms = tuple[tuple[float, float], ...]
"""Weights g and relaxation times tau in s."""

_ROWS, _COLUMNS = (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)
_COMPONENTS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


def tensors(components: np.ndarray) -> np.ndarray:
    """Assemble symmetric tensors (3, 3) from their six components.

    Parameters
    ----------
    components : (..., 6) ndarray
        Components xx, yy, zz, xy, yz, xz.

    Returns
    -------
    (..., 3, 3) ndarray
        The tensors.
    """
    return components[..., _COMPONENTS]


def components(tensors: np.ndarray) -> np.ndarray:
    """Components (..., 6) of symmetric tensors (..., 3, 3): xx, yy, zz, xy, yz, xz."""
    return tensors[..., _ROWS, _COLUMNS]


class Weights(NamedTuple):
    """Factors in the update of the stress Q of each of the k terms of a Prony series over a time step of the length h.

    Attributes
    ----------
    decay : (k,) ndarray
        Factor of Q at the start.
    ramp : (k,) ndarray
        Factor of a linear change of S, without the weight g.
    curvature : (k,) ndarray
        Error of a linear change of S, divided by h² S'', where S'' is the second derivative.
    """

    decay: np.ndarray
    ramp: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True)
class Viscoelastic(Displayed):
    """A silicone whose stress relaxes: an elastic law with a Prony series.

    Parameters
    ----------
    law : Material
        Instantaneous law: ``youngs_modulus`` and all other constants apply to loads faster than the shortest relaxation
        time. Long after the longest relaxation time, stresses are (1 - sum of g) times as large.
    prony : sequence of (float, float)
        Terms (g, tau): the share of the stress that relaxes, and its relaxation time in s.

    Raises
    ------
    InputError
        if a share or a time is not above 0, or the shares add up to 1 or more.
    """

    law: Material
    prony: Terms
    softening: ClassVar[Mullins | None] = None

    def __post_init__(self) -> None:
        require("law", self.law, Material, "a Material, such as NeoHookean,")
        object.__setattr__(self, "prony", checked_terms(self.prony))

    @property
    def has_memory(self) -> bool:
        """Whether the stress of a point depends on its earlier strains."""
        return bool(self.prony) or self.softening is not None

    @property
    def shares(self) -> np.ndarray:
        """Weights g (k,) of the terms of the Prony series."""
        return np.array([weight for weight, _ in self.prony])

    @property
    def times(self) -> np.ndarray:
        """Relaxation times tau (k,) of the terms of the Prony series, in s."""
        return np.array([time for _, time in self.prony])

    def relaxation(self, time: float | np.ndarray) -> np.ndarray:
        """Fraction of the stress that remains after a step of the strain: the Prony series.

        Parameters
        ----------
        time : float or (...) ndarray
            Time after the step, s.

        Returns
        -------
        (...) ndarray
            Fractions, from 1 at time 0 to 1 - sum of g after a long time.
        """
        return 1 + np.expm1(-np.asarray(time, dtype=float)[..., None] / self.times) @ self.shares

    def over(self, step: float) -> Weights:
        """Factors by which a time step with a duration ``step`` in s changes the stress of each term of the Prony
        series."""
        x = np.minimum(step / self.times, LONGEST)
        series = x / 12 - x**2 / 24 + x**3 / 80
        clipped = np.maximum(x, SHORT)
        decay, ramp = np.exp(-x), np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1.0)
        with np.errstate(under="ignore"):
            closed_form = -0.5 * np.expm1(-clipped) / clipped - (1 - np.exp(-clipped) * (1 + clipped)) / clipped**2
        return Weights(decay, ramp, np.where(x < SHORT, series, closed_form))


@dataclass(frozen=True)
class Elastic(Viscoelastic):
    """A silicone without relaxation, whose states depend on earlier states because of friction or Mullins' effect. It
    is a viscoelastic material without relaxing terms.
    """

    prony: Terms = ()
    softening: Mullins | None = None  # type: ignore[misc]

    def __post_init__(self) -> None:
        """Do nothing: a silicone without relaxing terms needs no check of them."""


def checked_terms(prony: object) -> Terms:
    """Check the terms of a Prony series.

    Parameters
    ----------
    prony : sequence of (float, float)
        Pairs of a weight and a relaxation time in s.

    Returns
    -------
    tuple[tuple[float, float], ...]
        The pairs.

    Raises
    ------
    InputError
        if they are no such pairs, a number is not above 0, or the weights add up to 1 or more.
    """

    def is_pair(term: object) -> bool:
        return is_row(term, is_number) and len(term) == 2  # type: ignore[arg-type]

    if not (is_row(prony, is_pair) and len(prony)):  # type: ignore[arg-type]
        raise refusal("prony", prony, "at least one pair of numbers, a weight and a relaxation time in s, is needed")
    terms: Sequence[Sequence[float]] = prony  # type: ignore[assignment]
    if len(terms) > MOST_TERMS:
        raise InputError(f"prony with {len(terms)} terms is not allowed: at most {MOST_TERMS} are possible.")
    for weight, time in terms:
        if not (weight > 0 and time > 0):
            raise InputError(f"prony term {weight:g} {time:g} is not allowed: a weight and a time above 0 are needed.")
    total = sum(weight for weight, _ in terms)
    if not total < 1:
        raise InputError(
            f"prony weights that add up to {total:g} are not allowed: less than 1 is needed, or no stiffness remains."
        )
    return tuple((float(weight), float(time)) for weight, time in terms)


def prony_of(text: str) -> Terms:
    """The terms of a Prony series from a text such as ``0.2 1; 0.1 10``.

    Parameters
    ----------
    text : str
        Weights, relative to the instantaneous stress, and relaxation times in s.

    Returns
    -------
    tuple[tuple[float, float], ...]
        Weights and times; empty if the text is blank.

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
        raise InputError(f"prony = {text!r} is not allowed: terms 'weight time', separated by ';', are needed.")
    return checked_terms(terms)
