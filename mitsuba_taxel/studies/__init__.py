"""Batches of scenes over varied parameters, and the store of their results."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.studies.dataset import stage_totals, study_error_budget
    from mitsuba_taxel.studies.deformation import deform
    from mitsuba_taxel.studies.opening import open_study
    from mitsuba_taxel.studies.steps import read_steps
    from mitsuba_taxel.studies.study import Progress, run_study, sweep
    from mitsuba_taxel.studies.templates import write_template
    from mitsuba_taxel.studies.training import training_set

_LAZY = {
    "Progress": "study",
    "deform": "deformation",
    "open_study": "opening",
    "read_steps": "steps",
    "run_study": "study",
    "stage_totals": "dataset",
    "study_error_budget": "dataset",
    "sweep": "study",
    "training_set": "training",
    "write_template": "templates",
}

__all__ = [
    "Progress",
    "deform",
    "open_study",
    "read_steps",
    "run_study",
    "stage_totals",
    "study_error_budget",
    "sweep",
    "training_set",
    "write_template",
]


def __getattr__(name: str) -> object:
    # xarray is loaded by those who sweep, and by nobody else.
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
