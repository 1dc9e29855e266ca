"""Display of objects in notebooks; the HTML is supplied by a room above the object's own."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar


class Displayed:
    """Base of classes whose objects notebooks show as HTML.

    Attributes
    ----------
    html_of : Callable[[Displayed], str]
        Returns the HTML of any such object; set by the package.
    """

    html_of: ClassVar[Callable[[Displayed], str]]

    def _repr_html_(self) -> str:
        return Displayed.html_of(self)
