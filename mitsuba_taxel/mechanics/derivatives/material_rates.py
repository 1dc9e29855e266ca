"""Derivatives of a pad's internal forces and volumes with respect to the constants of its material, at constant
displacements."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material

RELATIVE_STEP = 1e-3
"""Relative change of a material parameter for differences of fourth order, which are accurate to 1e-11."""
SMALL_STEP = 1e-5
"""Relative change for differences of second order, which are accurate to about 1e-9: for laws that do not allow the
larger change."""


def material_rate(residual_of: Callable[[Material], np.ndarray], material: Material, name: str) -> np.ndarray:
    """Derivative of a pad's residual with respect to a parameter of its material.

    The derivative is a central difference of fourth order. If the law does not allow changes that large, it is a
    difference of second order.

    Parameters
    ----------
    residual_of : Callable[[Material], ndarray]
        Computes the residual (n,) with a material.
    material : Material
        Law of the state.
    name : str
        Name of the parameter.

    Returns
    -------
    (n,) ndarray
        Derivative per unit of the parameter.
    """
    value = getattr(material, name)
    scale = abs(value) or _scale(material, name)

    def residual(change: float) -> np.ndarray:
        return residual_of(material.changed(**{name: value + change}))

    step = RELATIVE_STEP * scale
    if _allows(material, name, value + 2 * step) and _allows(material, name, value - 2 * step):
        wide, narrow = (residual(k * step) - residual(-k * step) for k in (2, 1))
        return (8 * narrow - wide) / (12 * step)
    step = SMALL_STEP * scale
    upwards, downwards = (_allows(material, name, value + change) for change in (step, -step))
    if upwards and downwards:
        return (residual(step) - residual(-step)) / (2 * step)
    if not upwards:
        step = -step
    return (4 * residual(step) - 3 * residual(0.0) - residual(2 * step)) / (2 * step)


def _allows(material: Material, name: str, value: float) -> bool:
    try:
        material.changed(**{name: value})
    except InputError:
        return False
    return True


def _scale(material: Material, name: str) -> float:
    """Scale of the change of a material parameter in a difference quotient if the value of the parameter is 0: 1 for
    Poisson's ratio, the shear modulus for all others.
    """
    return 1.0 if name == "poisson_ratio" else material.shear_modulus
