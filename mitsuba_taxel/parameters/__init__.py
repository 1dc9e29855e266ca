"""Parameters: fields of dataclasses with allowed values, which are checked when an object is created.

Input: values from scenes, command lines or Python. Output: objects whose values have been checked, and the descriptions
from which tables, schema and messages are made.
"""

from mitsuba_taxel.parameters.checked import Checked, Kinded, check, parameters_of, values_of
from mitsuba_taxel.parameters.declarations import (
    choice,
    field_of,
    kind,
    nested,
    number,
    parameter_field,
    switch,
    text,
    transform,
    vector,
    whole,
)
from mitsuba_taxel.parameters.parameter import (
    REQUIRED,
    Choice,
    Nested,
    Number,
    Parameter,
    Points,
    Switch,
    Vector,
    Whole,
)

__all__ = [
    "REQUIRED",
    "Checked",
    "Choice",
    "Kinded",
    "Nested",
    "Number",
    "Parameter",
    "Points",
    "Switch",
    "Vector",
    "Whole",
    "check",
    "choice",
    "field_of",
    "kind",
    "nested",
    "number",
    "parameter_field",
    "parameters_of",
    "switch",
    "text",
    "transform",
    "values_of",
    "vector",
    "whole",
]
