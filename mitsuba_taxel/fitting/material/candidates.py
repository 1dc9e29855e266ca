"""Laws to be fitted: nominal stress of incompressible solids in closed form, and start values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from mitsuba_taxel.mechanics.materials.laws import ArrudaBoyce, Material, MooneyRivlin, NeoHookean, Ogden, Yeoh
from mitsuba_taxel.mechanics.materials.laws.arruda_boyce import LANGEVIN

EXPONENTS = (-8.0, -4.0, -2.0, -1.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0, 14.0)
"""Exponents of Ogden's law from which fits start."""
LOCKING = (1.1, 1.5, 2.0, 3.0, 5.0, 10.0, 40.0)
"""Locking stretches from which fits start."""
POISSON_RATIO = 0.49


def principal(mode: str, stretch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Second and third principal stretch (n,) of a test mode, such as uniaxial tension, at constant volume."""
    powers = {"uniaxial": (-0.5, -0.5), "planar": (0.0, -1.0), "equibiaxial": (1.0, -2.0)}[mode]
    return stretch ** powers[0], stretch ** powers[1]


@dataclass(frozen=True)
class Candidate:
    """A hyperelastic law with a given number of terms, to be fitted to tests.

    The nominal stress is linear in the moduli (constants in MPa): it is a sum of columns, each multiplied by a modulus.
    Columns are functions of the stretch; they may depend on shape parameters, such as the exponents of Ogden's law.

    Attributes
    ----------
    label : str
        Name in tables.
    moduli, shapes : tuple[str, ...]
        Names of the constants in MPa, and of the shape parameters.
    columns : Callable
        Function of the test mode, n stretches and the shape parameters, which returns the columns (n, moduli).
    starts : tuple[tuple[float, ...], ...]
        Shape parameters from which fits start.
    bounds : tuple[float, float]
        Bounds of the shape parameters.
    positive : bool
        Whether all moduli must be 0 or more.
    build : Callable
        Function that returns the law with given constants, by name.
    """

    label: str
    moduli: tuple[str, ...]
    columns: Callable[[str, np.ndarray, tuple[float, ...]], np.ndarray]
    build: Callable[[Mapping[str, float]], Material]
    shapes: tuple[str, ...] = ()
    starts: tuple[tuple[float, ...], ...] = ((),)
    bounds: tuple[float, float] = (-np.inf, np.inf)
    positive: bool = False

    @property
    def law(self) -> str:
        """Name of the law in scenes."""
        return self.label.partition(",")[0]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all constants: moduli, then shape parameters."""
        return (*self.moduli, *self.shapes)

    def stress(self, mode: str, stretch: np.ndarray, constants: np.ndarray) -> np.ndarray:
        """Nominal stress (n,) in MPa; ``constants`` are in the order of `names`."""
        count = len(self.moduli)
        return self.columns(mode, stretch, tuple(constants[count:])) @ constants[:count]


def _invariant(mode: str, stretch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quantities of a test mode at n stretches: I1 - 3 (n,), and the factor 2 (l - l3^2 / l) (n,) from dW/dI1 to the
    nominal stress."""
    second, third = principal(mode, stretch)
    return stretch**2 + second**2 + third**2 - 3, 2 * (stretch - third**2 / stretch)


def _yeoh(terms: int) -> Callable[[str, np.ndarray, tuple[float, ...]], np.ndarray]:
    def columns(mode: str, stretch: np.ndarray, _shapes: tuple[float, ...]) -> np.ndarray:
        excess, factor = _invariant(mode, stretch)
        return np.stack([(i + 1) * excess**i * factor for i in range(terms)], axis=1)

    return columns


def _mooney(mode: str, stretch: np.ndarray, _shapes: tuple[float, ...]) -> np.ndarray:
    factor = _invariant(mode, stretch)[1]
    return np.stack([factor, factor * principal(mode, stretch)[0] ** 2], axis=1)


def _ogden(mode: str, stretch: np.ndarray, exponents: tuple[float, ...]) -> np.ndarray:
    logarithm, third = np.log(stretch), np.log(principal(mode, stretch)[1])
    terms = [2 / a * (np.exp((a - 1) * logarithm) - np.exp(a * third - logarithm)) for a in map(_not_zero, exponents)]
    return np.stack(terms, axis=1)


def _not_zero(exponent: float) -> float:
    return exponent if abs(exponent) > 1e-6 else 1e-6


def _chains(mode: str, stretch: np.ndarray, shapes: tuple[float, ...]) -> np.ndarray:
    excess, factor = _invariant(mode, stretch)
    sum_of_terms = sum(
        i * c * (excess + 3) ** (i - 1) / shapes[0] ** (2 * i - 2) for i, c in enumerate(LANGEVIN, 1)
    )
    return (factor * sum_of_terms)[:, None]


def _ogden_candidate(terms: int) -> Candidate:
    numbers = range(1, terms + 1)
    moduli, exponents = (tuple(f"{name}_{i}" for i in numbers) for name in ("mu", "alpha"))
    starts = tuple(combinations(EXPONENTS, terms))
    return Candidate(
        f"ogden, {terms} term{'s' if terms > 1 else ''}",
        moduli,
        _ogden,
        lambda constants: Ogden(**constants),
        exponents,
        starts,
        (-15.0, 15.0),
        positive=True,
    )


def _linear(label: str, moduli: tuple[str, ...], columns: Any, law: Any) -> Candidate:
    return Candidate(label, moduli, columns, lambda constants: law(**constants))


CANDIDATES = (
    Candidate(
        "neo_hookean",
        ("shear_modulus",),
        lambda mode, stretch, _: 0.5 * _yeoh(1)(mode, stretch, ()),
        lambda constants: NeoHookean(2 * constants["shear_modulus"] * (1 + POISSON_RATIO), POISSON_RATIO),
    ),
    _linear("mooney_rivlin", ("c10", "c01"), _mooney, MooneyRivlin),
    _linear("yeoh, 2 terms", ("c10", "c20"), _yeoh(2), Yeoh),
    _linear("yeoh, 3 terms", ("c10", "c20", "c30"), _yeoh(3), Yeoh),
    Candidate(
        "arruda_boyce", ("chain_modulus",), _chains, lambda constants: ArrudaBoyce(**constants), ("locking_stretch",),
        tuple((value,) for value in LOCKING), (1.001, 100.0), positive=True,
    ),
    *(_ogden_candidate(terms) for terms in (1, 2, 3)),
)  # fmt: skip
"""All laws; of laws of the same kind, those with fewer constants come first."""


def flexible_columns(mode: str, stretch: np.ndarray) -> np.ndarray:
    """Columns (n, 4) of a law that can follow any curve of one mode: Yeoh's three columns, and Mooney-Rivlin's
    second."""
    # In planar tension I1 = I2, so both columns of Mooney-Rivlin are equal: a logarithm replaces one of them.
    factor = _invariant(mode, stretch)[1]
    fourth = _mooney(mode, stretch, ())[:, 1] if mode != "planar" else factor / stretch
    return np.column_stack([_yeoh(3)(mode, stretch, ()), fourth])
