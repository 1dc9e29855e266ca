"""First contacts of designs, from the study of their loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.optimum.figures import FIRST_CONTACT, TO_THE_END, DesignResponses
from mitsuba_taxel.optimum.plan import Design, Limit, Plan
from mitsuba_taxel.sensing.derivatives.first_contact import why_no_contact
from mitsuba_taxel.studies.plan.batch import Batch


class DesignContact(NamedTuple):
    """The load at which the pad of a design first touches something, along a line of loads, with derivatives.

    Attributes
    ----------
    value : float
        Load at the first contact, or at the end of the load path; NaN if unknown.
    touched : str
        Object that the pad touches; empty without contact.
    ended : str
        Reason why the load path ends without contact, else empty.
    by : list[float]
        Derivatives of ``value`` with respect to each variable, scaled to the unit cube.
    by_tolerance : list[float]
        Change of ``value`` by one standard deviation of each parameter with a tolerance.
    missing : bool
        Whether the load path ends without contact and the derivatives of its end are unknown. All derivatives are
        then 0.
    """

    value: float
    touched: str
    ended: str
    by: list[float]
    by_tolerance: list[float]
    missing: bool = False

    @classmethod
    def from_study(cls, study: xr.Dataset, row: int, by: list[float], by_tolerance: list[float]) -> DesignContact:
        """The first contact of a design's pad, as stored in a row of a study, with the given derivatives."""
        touched, ended = (str(study[name].values[row]) if name in study else "" for name in ("touched", "ended"))
        missing = bool(ended) and not np.isfinite([*by, *by_tolerance]).all()
        if missing:
            by, by_tolerance = [0.0] * len(by), [0.0] * len(by_tolerance)
        return cls(first_contact_in(study, row), touched, ended, by, by_tolerance, missing)


def first_contact_in(study: xr.Dataset, row: int, of: str = "") -> float:
    """Load at the first contact in a row of a study, or its derivative with ``of="_derivative"``; NaN if unknown."""
    name = f"first_contact{of}"
    return float(study[name].values[row]) if name in study else np.nan


def lines_without_contact(plan: Plan, batch: Batch, designs: Sequence[Design]) -> dict[str, str]:
    """Find the lines of loads along which the first contact of a pad cannot be computed, with the reasons.

    Parameters
    ----------
    plan : Plan
        The optimisation.
    batch : Batch
        Scene and settings of the readings.
    designs : Sequence[Design]
        Designs to test, one for each combination of choices.

    Returns
    -------
    dict[str, str]
        Reason by line. A measuring range along such a line is limited by saturation only.

    Raises
    ------
    InputError
        if the first contact along such a line is a figure of the study.
    """
    reasons = {}
    for line in plan.to_contact:
        along, rows = plan.lines[line]
        scenes = (batch.scene(plan.scene_parameters(design) | rows[-1]) for design in designs)
        refused = next(filter(None, (why_no_contact(scene, along) for scene in scenes)), None)
        if refused is not None:
            if any(figure.kind == FIRST_CONTACT and figure.parameters["along"] == line for figure in plan.figures):
                raise InputError(refused)
            reasons[line] = refused
    return reasons


def undetermined_end(plan: Plan, responses: DesignResponses, contacts: Mapping[str, DesignContact]) -> str:
    """Reason why a figure of a design is undetermined; empty if all figures are determined.

    A constraint that the design meets at the end of the path needs no derivatives.
    """
    for criterion in (*plan.criteria, *([plan.front[0]] if plan.front else [])):
        end = contacts.get(criterion.figure.parameters["along"]) if criterion.figure.kind in TO_THE_END else None
        if end is not None and end.missing:
            least = criterion.figure.components(responses).real.min()
            bears = isinstance(criterion, Limit) and criterion.sign < 0 and criterion.bound <= least
            if least == abs(end.value) and not bears:
                return end.ended
    return ""
