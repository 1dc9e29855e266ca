"""Display of objects in notebooks; the HTML is supplied by another package, which may import the package of the
object."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar


class Displayed:
    """Base of classes whose objects are shown in notebooks as HTML.

    Attributes
    ----------
    html_of : Callable[[Displayed], str]
        Function that returns the HTML of an object; assigned when ``mitsuba_taxel`` is imported.
    """

    html_of: ClassVar[Callable[[Displayed], str]]

    def _repr_html_(self) -> str:
        return Displayed.html_of(self)
