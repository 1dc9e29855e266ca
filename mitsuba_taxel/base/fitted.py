"""Fits of objects to measurements; the fit is supplied by another package, which may import the package of the
object."""

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
