"""Values of a load with their times, for viscoelastic silicones."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.arguments import array_of, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic


def rubs(load: Load) -> bool:
    """Whether a load has friction, so that states depend on earlier ones."""
    return load.indenter is not None and load.indenter.friction > 0


Row = tuple[float, tuple[float, ...]]
"""Time in s, and value of the load."""


def timed_rows(material: Material | Viscoelastic, load: Load, values: np.ndarray, times: object) -> tuple[Row, ...]:
    """The rows of a load, none if states depend on its value alone; raises `InputError`.

    For friction on an elastic material, all are at 0 s, and the indenter first moves down, then sideways.
    """
    if not isinstance(material, Viscoelastic):
        if times is not None:
            raise refusal("times", times, f"{material} is elastic, and only a Viscoelastic has times; none are needed")
        if not rubs(load):
            return ()
        for value in values:
            load.check(value)
        first = [(0.0, 0.0, values[0][2])] if values[0][:2].any() else []
        return tuple((0.0, tuple(map(float, value))) for value in [*first, *values])
    if times is None:
        raise InputError("times are missing: a viscoelastic silicone needs the time of each value of its load.")
    for value in values:
        load.check(value)
    when = array_of("times", times, (len(values),))
    before = np.concatenate([[0.0], when[:-1]])
    wrong = np.flatnonzero(when < before)
    if len(wrong):
        number = wrong[0]
        raise InputError(
            f"times[{number}] = {when[number]:g} s is not allowed: at least {before[number]:g} s is needed."
        )
    return tuple((float(time), tuple(map(float, value))) for time, value in zip(when, values, strict=True))
