"""Factors that scale several parameters, such as the shrinkage of a mould: correlated tolerances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.tolerances.laws import Law, law_of

SCALES = "scales"
"""Key of a factor's table: the parameters that it multiplies."""


@dataclass(frozen=True, eq=False)
class Factors:
    """Independent random variables of a tolerance study, and the parameters of the scene as products of them.

    A factor, such as a shrinkage, multiplies several parameters, which are then correlated.

    Attributes
    ----------
    laws : list[Law]
        Distributions of the independent variables: of single parameters, and of factors.
    products : dict[str, tuple[str, ...]]
        For each varying parameter of the scene, the names of the distributions whose values are multiplied.
    constants : dict[str, float]
        Values in the scene of parameters that only factors vary.
    """

    laws: list[Law]
    products: dict[str, tuple[str, ...]]
    constants: dict[str, float]

    def parameters(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values of the scene's parameters, by name, for given values of the independent variables."""
        return {
            name: math.prod((values[law] for law in laws), start=self.constants.get(name, 1.0))
            for name, laws in self.products.items()
        }

    def partial_derivatives(self, law: str) -> dict[str, float]:
        """Derivatives of the scene's parameters with respect to one independent variable (law), at the mean of all
        variables.
        """
        means = {other_law.name: 1.0 if other_law.name == law else other_law.mean for other_law in self.laws}
        return {name: value for name, value in self.parameters(means).items() if law in self.products[name]}

    def notes(self) -> list[str]:
        """Notes on the meaning of Sobol' indices where parameters are correlated."""
        lines = []
        for law in self.laws:
            scaled = [name for name, laws in self.products.items() if law.name in laws and law.name != name]
            own = [name for name in scaled if name not in self.constants]
            if scaled:
                rest = f"; the index of {', '.join(own)} is that of its own law, without {law.name}" if own else ""
                lines.append(
                    f"{', '.join(scaled)} vary with {law.name}: shares and Sobol' indices are those of independent "
                    f"laws, and {law.name} is one of these{rest}"
                )
        return lines


def read_factors(tables: Mapping[str, object], values: Mapping[str, str]) -> Factors:
    """Read the distributions in the table ``[tolerance.of]`` of a study file.

    Raises
    ------
    InputError
        if a law is refused, or a factor scales something that is not a numeric parameter.
    """
    laws, scales = [], {}
    for name, table in tables.items():
        if isinstance(table, Mapping) and SCALES in table:
            law = law_of(name, {key: value for key, value in table.items() if key != SCALES})
            scales[name] = _scaled(name, table[SCALES], values)
            laws.append(replace(law, words=f"{law.words} x {', '.join(scales[name])}"))
        else:
            laws.append(law_of(name, table))
    products: dict[str, tuple[str, ...]] = {law.name: (law.name,) for law in laws if law.name not in scales}
    constants = {}
    for factor, names in scales.items():
        for name in names:
            if name not in products:
                constants[name] = _constant(factor, name, values[name])
            products[name] = (*products.get(name, ()), factor)
    return Factors(laws, products, constants)


def _scaled(factor: str, names: object, values: Mapping[str, str]) -> tuple[str, ...]:
    """Distinct names of the parameters that a factor scales; raises `InputError` for anything else."""
    if factor in values:
        raise InputError(
            f"tolerance of {factor}: {SCALES} is not allowed, as {factor} is a parameter of the scene: a factor needs "
            "another name."
        )
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise InputError(
            f'tolerance of {factor}: {SCALES} = {names!r} is not allowed: ["cell_size", ...], a list of parameters of '
            "the scene, is needed."
        )
    for name in names:
        if name not in values:
            raise InputError(
                f"tolerance of {factor}: {SCALES} = {name} is not a parameter of the scene: one of "
                f"{', '.join(values) or 'its <default>s'} is needed."
            )
    return tuple(dict.fromkeys(names))


def _constant(factor: str, name: str, word: str) -> float:
    """The number, other than 0, of a parameter that a factor scales; raises `InputError` if it is none."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value):
        raise InputError(
            f"tolerance of {factor}: {name} = {word} cannot be scaled: a number other than 0 is needed, or a law for "
            f"{name} itself."
        )
    return value
