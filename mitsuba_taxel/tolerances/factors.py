"""Factors that scale several parameters, as the shrinkage of a mould does: tolerances that are correlated."""

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
    """Independent laws, and the parameters of a scene as products of them.

    Attributes
    ----------
    laws : list[Law]
        Distributions of parameters, and of factors that scale several parameters.
    products : dict[str, tuple[str, ...]]
        For each parameter of the scene that varies, the names of the laws whose product it is.
    constants : dict[str, float]
        For each of them that has no law of its own, its value in the scene, which the factors multiply.
    """

    laws: list[Law]
    products: dict[str, tuple[str, ...]]
    constants: dict[str, float]

    def parameters(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Parameters of the scene from values of the laws, numbers or arrays."""
        return {
            name: math.prod((values[law] for law in laws), start=self.constants.get(name, 1.0))
            for name, laws in self.products.items()
        }

    def partial_derivatives(self, law: str) -> dict[str, float]:
        """Derivatives of the parameters that depend on a law by it, at the mean of all laws."""
        others = {each.name: 1.0 if each.name == law else each.mean for each in self.laws}
        return {name: value for name, value in self.parameters(others).items() if law in self.products[name]}

    def notes(self) -> list[str]:
        """What Sobol' indices mean where parameters are correlated."""
        made = []
        for law in self.laws:
            scaled = [name for name, laws in self.products.items() if law.name in laws and law.name != name]
            own = [name for name in scaled if name not in self.constants]
            if scaled:
                rest = f"; that of {', '.join(own)} is of what {law.name} leaves of it" if own else ""
                made.append(
                    f"{', '.join(scaled)} vary with {law.name}: shares and Sobol' indices are those of the independent "
                    f"laws, {law.name} one of them{rest}"
                )
        return made


def read_factors(tables: Mapping[str, object], values: Mapping[str, str]) -> Factors:
    """The laws in the table ``[tolerance.of]``, for a scene whose parameters have these values.

    Raises
    ------
    InputError
        if a law is refused, or a factor scales what is no parameter with a number.
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
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value):
        raise InputError(
            f"tolerance of {factor}: {name} = {word} cannot be scaled: a number other than 0 is needed, or a law of "
            f"its own for {name}."
        )
    return value
