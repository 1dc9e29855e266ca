"""First contacts of designs, as their study has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.optimum.figures import FIRST_CONTACT, TO_THE_END, Seen
from mitsuba_taxel.optimum.plan import Design, Limit, Plan
from mitsuba_taxel.sensing.derivatives.first_contact import why_no_contact
from mitsuba_taxel.studies.plan.batch import Batch


class DesignContact(NamedTuple):
    """A first contact: its value, what is touched, why the path ends before, and derivatives with respect to each
    variable, in the unit cube, and each parameter with a tolerance, per standard deviation. Where a path ends, and its
    derivatives are not known, they are ``missing``, and 0."""

    value: float
    touched: str
    ended: str
    by: list[float]
    off: list[float]
    missing: bool = False

    @classmethod
    def told(cls, study: xr.Dataset, row: int, by: list[float], off: list[float]) -> DesignContact:
        """That of a row of a study."""
        touched, ended = (str(study[name].values[row]) if name in study else "" for name in ("touched", "ended"))
        missing = bool(ended) and not np.isfinite([*by, *off]).all()
        if missing:
            by, off = [0.0] * len(by), [0.0] * len(off)
        return cls(first_contact_in(study, row), touched, ended, by, off, missing)


def first_contact_in(study: xr.Dataset, row: int, of: str = "") -> float:
    """That of a row of a study, or its ``_derivative``; NaN if unknown."""
    name = f"first_contact{of}"
    return float(study[name].values[row]) if name in study else np.nan


def lines_untold(plan: Plan, batch: Batch, designs: Sequence[Design]) -> dict[str, str]:
    """Lines along which a range does not know the first contact, with the reasons.

    Raises
    ------
    InputError
        if there is one for which the first contact is a figure by itself.
    """
    found = {}
    for line in plan.to_contact:
        along, rows = plan.lines[line]
        scenes = (batch.scene(plan.told(design) | rows[-1]) for design in designs)
        refused = next(filter(None, (why_no_contact(scene, along) for scene in scenes)), None)
        if refused is not None:
            if any(one.kind == FIRST_CONTACT and one.told["along"] == line for one in plan.figures):
                raise InputError(refused)
            found[line] = refused
    return found


def why_untold(plan: Plan, seen: Seen, contacts: Mapping[str, DesignContact]) -> str:
    """Why a figure of a design cannot be told where the derivatives of a path's end are missing; empty if it can, as
    where the design bears as much as is asked for."""
    for asked in (*plan.asked, *([plan.front[0]] if plan.front else [])):
        end = contacts.get(asked.figure.told["along"]) if asked.figure.kind in TO_THE_END else None
        if end is not None and end.missing:
            least = asked.figure.components(seen).real.min()
            bears = isinstance(asked, Limit) and asked.sign < 0 and asked.bound <= least
            if least == abs(end.value) and not bears:
                return end.ended
    return ""
