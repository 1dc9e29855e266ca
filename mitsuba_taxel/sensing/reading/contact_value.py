"""Value of the load at which a pad first touches itself, the board or a package."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class FirstContact:
    """The value of a load parameter at which a pad first touches itself, the board or a package.

    Attributes
    ----------
    value : float
        Value of the load parameter at the first contact, in the unit of the parameter. Without contact, it is the
        furthest requested value, or the value at which the pad becomes unstable or the load path ends for another
        reason.
    rates : (P,) ndarray
        Derivatives of ``value`` with respect to P other parameters; 0 if the furthest requested value is reached, NaN
        if the path ends for a reason other than contact or instability.
    touched : str
        Object that the pad touches: ``itself``, ``the board`` or ``a package``; empty without contact.
    ended : str
        Reason why the load path ends without contact, such as an instability; empty if it does not.
    """

    value: float
    rates: np.ndarray
    touched: str
    ended: str = ""
