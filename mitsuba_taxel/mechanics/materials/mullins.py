"""Mullins' effect: a silicone that was stretched once is softer up to that stretch.

With W the isochoric energy density of a law and Wm its largest value so far at the point, the isochoric stress of the
law is multiplied by ::

    eta = 1 - erf((Wm - W) / (m + beta Wm)) / r,    W < Wm

and by 1 while W grows beyond Wm (R. W. Ogden and D. G. Roxburgh, Proc. R. Soc. A 455, 2861, 1999, with beta = 0; with
beta as in Abaqus, *Mullins effect*, and A. Dorfmann and R. W. Ogden, Int. J. Solids Struct. 40, 2699, 2003). The
pressure, which enforces the volume, is not changed. There is no permanent set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.arguments import is_number, refusal, require
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material

SLOPE_AT_ZERO = 2 / math.sqrt(math.pi)
"""Derivative of the error function at 0."""


@dataclass(frozen=True)
class Mullins(Displayed):
    """A silicone with Mullins' effect, by the law of Ogden and Roxburgh.

    Parameters
    ----------
    law : Material
        Law of the first loading.
    r : float
        Above 1. On unloading from a large strain, the stress is at least 1 - 1 / r times that of the law.
    m : float
        Energy density in MPa, above 0, over which the stress falls when the load turns; the smaller it is, the more
        small strains soften.
    beta : float
        Fraction of the largest energy density so far that is added to ``m``, 0 or more.

    Raises
    ------
    InputError
        if a constant is not allowed.
    """

    law: Material
    r: float
    m: float
    beta: float = 0.0

    def __post_init__(self) -> None:
        require("law", self.law, Material, "a Material, such as NeoHookean,")
        for name, allowed, needed in (
            ("r", lambda r: r > 1, "a finite number above 1 is needed"),
            ("m", lambda m: m > 0, "a finite energy density in MPa above 0 is needed"),
            ("beta", lambda beta: beta >= 0, "a finite number of 0 or more is needed"),
        ):
            value = getattr(self, name)
            if not (is_number(value) and allowed(value)):
                raise refusal(f"mullins {name}", value, needed)

    @property
    def constants(self) -> tuple[float, float, float]:
        """The constants r, m in MPa, and beta of Mullins' effect."""
        return self.r, self.m, self.beta

    def damage_variable(self, energy: np.ndarray, largest: np.ndarray) -> np.ndarray:
        """Ratio eta of the isochoric stress of the softened silicone to the stress of the law at the same strain.

        Parameters
        ----------
        energy : (...) ndarray
            Isochoric energy density W of the law in MPa.
        largest : (...) ndarray
            Largest value of W so far, in MPa.

        Returns
        -------
        (...) ndarray
            1 where ``energy`` is the largest so far, else between 1 - 1 / r and 1.
        """
        from scipy.special import erf

        return 1 - erf(self._distance(energy, largest)) / self.r

    def damage_slope(self, energy: np.ndarray, largest: np.ndarray) -> np.ndarray:
        """Derivative of :meth:`damage_variable` with respect to the energy density.

        Parameters
        ----------
        energy, largest : (...) ndarray
            Energy density of the law and its largest value so far, MPa.

        Returns
        -------
        (...) ndarray
            Derivative in 1/MPa; 0 where ``energy`` is at least the largest so far.
        """
        slope = SLOPE_AT_ZERO * np.exp(-(self._distance(energy, largest) ** 2))
        return np.where(energy < largest, slope / (self.r * self._width(largest)), 0.0)

    def dissipated(self, largest: float | np.ndarray) -> np.ndarray:
        """Energy density that is lost between the first loading and the complete unloading.

        It is the integral of 1 - eta over W from 0 to the largest energy density.

        Parameters
        ----------
        largest : float or (...) ndarray
            Largest energy density, MPa.

        Returns
        -------
        (...) ndarray
            Energy density in MPa.
        """
        from scipy.special import erf

        width = self._width(np.asarray(largest, dtype=float))
        end = np.asarray(largest) / width
        return width / self.r * (end * erf(end) + np.expm1(-(end**2)) / math.sqrt(math.pi))

    def _width(self, largest: np.ndarray) -> np.ndarray:
        return self.m + self.beta * largest

    def _distance(self, energy: np.ndarray, largest: np.ndarray) -> np.ndarray:
        return np.maximum(largest - energy, 0.0) / self._width(largest)


def mullins_of(text: str, law: Material) -> Mullins | None:
    """Mullins' effect from its constants as a text such as ``2 0.02 0.1``.

    Parameters
    ----------
    text : str
        The constants r, m in MPa and beta; beta may be left out.
    law : Material
        Law of the first loading.

    Returns
    -------
    Mullins or None
        None if the text is blank.

    Raises
    ------
    InputError
        if a constant is not allowed.
    """
    if not text.strip():
        return None
    try:
        constants = [float(word) for word in text.split()]
    except ValueError:
        constants = []
    if len(constants) not in (2, 3):
        raise InputError(f"mullins = {text!r} is not allowed: numbers 'r m beta', m in MPa, are needed.")
    return Mullins(law, *constants)
