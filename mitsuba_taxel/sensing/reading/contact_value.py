"""A first contact as numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class FirstContact:
    """A first contact.

    Attributes
    ----------
    value : float
        Value of the parameter that changes with the load. Without contact, it is the furthest requested value, or the
        value at which the pad becomes unstable or its path ends for another reason.
    rates : (P,) ndarray
        Derivatives of ``value`` with respect to other parameters; 0 if it is the furthest requested value, NaN if the
        path ends for another reason.
    touched : str
        Object that the pad touches: ``itself``, ``the board`` or ``a package``; empty if there is no contact.
    ended : str
        Reason why the path ends without contact, such as an instability; empty if it does not.
    """

    value: float
    rates: np.ndarray
    touched: str
    ended: str = ""
