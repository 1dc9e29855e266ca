"""Rates of a pad's internal forces and volumes with the constants of its material, at a fixed shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material

RELATIVE_STEP = 1e-3
"""Relative change of a material parameter for differences of fourth order, which are accurate to 1e-11."""
SMALL_STEP = 1e-5
"""The same, if the law does not allow that, for differences of second order, accurate to about 1e-9."""


def material_rate(put_up: Callable[[Material], np.ndarray], material: Material, name: str) -> np.ndarray:
    """Derivative of a pad's internal forces and volumes by one of its material's parameters.

    A central difference of fourth order, or of second order if the law does not allow larger changes.
    """
    value = getattr(material, name)
    scale = abs(value) or _scale(material, name)

    def inside(change: float) -> np.ndarray:
        return put_up(material.changed(**{name: value + change}))

    step = RELATIVE_STEP * scale
    if _allows(material, name, value + 2 * step) and _allows(material, name, value - 2 * step):
        wide, narrow = (inside(k * step) - inside(-k * step) for k in (2, 1))
        return (8 * narrow - wide) / (12 * step)
    step = SMALL_STEP * scale
    upwards, downwards = (_allows(material, name, value + change) for change in (step, -step))
    if upwards and downwards:
        return (inside(step) - inside(-step)) / (2 * step)
    if not upwards:
        step = -step
    return (4 * inside(step) - 3 * inside(0.0) - inside(2 * step)) / (2 * step)


def _allows(material: Material, name: str, value: float) -> bool:
    try:
        material.changed(**{name: value})
    except InputError:
        return False
    return True


def _scale(material: Material, name: str) -> float:
    """Scale of a parameter, also if it is 0: apart from Poisson's ratio, a modulus."""
    return 1.0 if name == "poisson_ratio" else material.shear_modulus
