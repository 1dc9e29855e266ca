"""Base of classes that can be fitted to measurements. Another package supplies the fit, because it imports the package
of the class.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar


class Fitted:
    """Base of classes whose objects can be fitted to measurements.

    Attributes
    ----------
    fit_of : Callable
        Function that fits a class to measurements; assigned when ``mitsuba_taxel`` is imported.
    """

    fit_of: ClassVar[Callable[..., Any]]
