"""Sources of error that stated errors do not contain: a sentence for each kind of result."""

from __future__ import annotations

_MODEL = "effects outside the model: drift, temperature, scatter of parts and of their assembly"
LEFT_OUT = {
    "calibration": "Intervals are valid for paths like those of the data; they leave out "
    f"{_MODEL}, and contact of another kind.",
    "fit": f"Errors leave out {_MODEL}; fixed parameters count as exact.",
    "model": f"Errors leave out {_MODEL}; outside the ranges of the inputs no error is known.",
    "report": f"Errors are those of the light, the finite elements and the surfaces; they leave out {_MODEL}.",
    "tolerance": "Spreads are those of the given tolerances alone; they leave out "
    f"{_MODEL.replace(', scatter of parts and of their assembly', '')}, and parameters without a tolerance.",
    "training": "Errors are those of the light alone; the error of the deformed pad is noted below. They leave out "
    f"{_MODEL}.",
}
"""Sentences by the kind of result."""
