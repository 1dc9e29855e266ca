"""Values of a load with their times, as a silicone with a memory needs them."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.arguments import array_of, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.elements.loads import IndenterForce, Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic

Row = tuple[float, tuple[float, ...]]
"""Time in s, and value of the load."""


def timed_rows(material: Material | Viscoelastic, load: Load, values: np.ndarray, times: object) -> tuple[Row, ...]:
    """The rows of a load, none for a material without a memory; raises `InputError`."""
    if not isinstance(material, Viscoelastic):
        if times is not None:
            raise refusal("times", times, f"{material} has no memory, only a Viscoelastic has; none are needed")
        return ()
    if times is None:
        raise InputError("times are missing: a silicone with a memory needs the time of each value of its load.")
    if isinstance(load, IndenterForce):
        raise refusal("load", load, "of a silicone with a memory, the displacement of an indenter is needed")
    when = array_of("times", times, (len(values),))
    before = np.concatenate([[0.0], when[:-1]])
    wrong = np.flatnonzero(when < before)
    if len(wrong):
        number = wrong[0]
        raise InputError(
            f"times[{number}] = {when[number]:g} s is not allowed: at least {before[number]:g} s is needed."
        )
    return tuple((float(time), tuple(map(float, value))) for time, value in zip(when, values, strict=True))
