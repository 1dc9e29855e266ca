"""The packages that mesh pads. Each of them is needed for some kinds of pads only, and cannot be installed on some
machines.
"""

from __future__ import annotations

import importlib.util

from mitsuba_taxel.base.errors import InputError


def has_netgen() -> bool:
    """Whether Netgen is installed."""
    return importlib.util.find_spec("netgen") is not None


def has_ftetwild() -> bool:
    """Whether fTetWild is installed, which meshes surfaces that Netgen cannot."""
    return importlib.util.find_spec("pytetwild") is not None


def require_netgen(what: str) -> None:
    """Raise unless Netgen is installed.

    Parameters
    ----------
    what : str
        Description of the task that needs Netgen, as the subject of a sentence.

    Raises
    ------
    InputError
        in one line that says how to install it, and what works without it.
    """
    if not has_netgen():
        raise InputError(
            f"{what} needs the package netgen-mesher, which is not installed: pip install netgen-mesher. It has no "
            "wheels for Linux on aarch64. Plates, fast models and pads without cells do not need it; pads from STL, "
            "PLY or OBJ files can use pytetwild instead."
        )
