"""Rates of a pad's internal forces and volumes with the constants of its material, at a fixed shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material

RELATIVE_STEP = 1e-3
"""Change of a parameter of the material that differences of fourth order are taken with: they are right to 1e-11."""
SMALL_STEP = 1e-5
"""Where the law does not allow that: differences of second order, right to about 1e-9."""


def material_rate(put_up: Callable[[Material], np.ndarray], material: Material, name: str) -> np.ndarray:
    """Derivative of a pad's internal forces and volumes by one of its material's parameters.

    A central difference of fourth order, or one of second order where the law does not allow larger changes.
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
    """What a parameter that is 0 is measured by; apart from Poisson's ratio it is a modulus."""
    return 1.0 if name == "poisson_ratio" else material.shear_modulus
