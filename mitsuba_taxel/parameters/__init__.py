"""Parameters: fields of dataclasses with allowed values, checked when an object is made."""

from mitsuba_taxel.parameters.checked import Checked, check, parameters_of, values_of
from mitsuba_taxel.parameters.parameter import (
    REQUIRED,
    Choice,
    Nested,
    Number,
    Parameter,
    Vector,
    Whole,
    choice,
    nested,
    number,
    stated,
    taken,
    text,
    transform,
    vector,
    whole,
)

__all__ = [
    "REQUIRED",
    "Checked",
    "Choice",
    "Nested",
    "Number",
    "Parameter",
    "Vector",
    "Whole",
    "check",
    "choice",
    "nested",
    "number",
    "parameters_of",
    "stated",
    "taken",
    "text",
    "transform",
    "values_of",
    "vector",
    "whole",
]
