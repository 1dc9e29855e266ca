"""The package `ipctk`, which computes the contact of a pad with itself and with obstacles; it is an extra."""

from __future__ import annotations

import importlib.util
from typing import Any

from mitsuba_taxel.base.errors import InputError


def require_ipctk() -> None:
    """Raise unless the package `ipctk` is installed, without importing it.

    Raises
    ------
    InputError
        in one line that says how to install it.
    """
    if importlib.util.find_spec("ipctk") is None:
        raise InputError(
            "self_contact needs the package ipctk: pip install ipctk, for which Linux on aarch64 needs a compiler."
        )


def ipctk_of_one_thread() -> Any:
    """Import the package `ipctk` and limit it to one thread: with several threads, the order of sums varies, and with
    it the last bits.

    Returns
    -------
    module
        The package.

    Raises
    ------
    InputError
        if it is not installed.
    """
    require_ipctk()
    import ipctk

    ipctk.set_num_threads(1)
    return ipctk
