"""A contact model as one Python file that needs JAX and numpy alone."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from mitsuba_taxel.surrogates.contact_iteration import iteration_of
from mitsuba_taxel.surrogates.contact_readings import ContactModel

_TEMPLATE = Path(__file__).with_name("template_files") / "contact_jax.txt"
LINE = 118
"""Length of a line of encoded numbers."""


def jax_of_contact(model: ContactModel, arrays: Mapping[str, Any], about: Mapping[str, Any]) -> str:
    """Write a contact model as the text of a Python module with a function ``read``.

    Parameters
    ----------
    model : ContactModel
        The model.
    arrays : Mapping[str, Any]
        Its arrays by name.
    about : Mapping[str, Any]
        Units, errors and origin, for JSON.

    Returns
    -------
    str
        Content of the file.

    Raises
    ------
    ComputationError
        if the iteration for the contact does not converge for this pad.
    """
    iteration = iteration_of(model)
    stored = {
        **arrays,
        "stiffness": np.linalg.inv(model.compliance),
        "operator": iteration.operator,
        "penalty": np.array(iteration.penalty),
        "count": np.array(iteration.most),
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, **stored)
    lines = "\n".join(wrap(base64.b64encode(packed.getvalue()).decode("ascii"), LINE))
    template = _TEMPLATE.read_text(encoding="utf-8")
    return (
        f'{template}\nMODEL = _arrays("""\n{lines}\n""")\n'
        f"ABOUT = json.loads({json.dumps(dict(about))!r})\n"
        "POINTS = _points()\n"
    )
