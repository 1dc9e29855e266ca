"""What the errors that the program states leave out, one sentence for each kind of result."""

from __future__ import annotations

_MODEL = "what the model leaves out: drift, temperature, scatter of parts and of their assembly"
LEFT_OUT = {
    "calibration": f"Intervals hold for paths like those given; they leave out {_MODEL}, and contact of another kind.",
    "fit": f"Errors leave out {_MODEL}; what is held fixed counts as exact.",
    "model": f"Errors leave out {_MODEL}; beyond the box nothing is stated.",
    "report": f"Errors are those of the light, the finite elements and the surfaces; they leave out {_MODEL}.",
    "tolerance": "Spreads are those of the stated tolerances alone; they leave out "
    f"{_MODEL.replace(', scatter of parts and of their assembly', '')}, and what has no tolerance here.",
    "training": f"Errors are those of the light alone; the deformed pad's is noted below, and they leave out {_MODEL}.",
}
"""By the kind of result."""
