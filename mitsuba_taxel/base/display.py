"""What a notebook shows of an object: said by the room that draws, which stands above the object's own."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar


class Displayed:
    """Base of classes whose objects notebooks show as HTML.

    Attributes
    ----------
    html_of : Callable[[Displayed], str]
        Gives the HTML of any such object; the package sets it.
    """

    html_of: ClassVar[Callable[[Displayed], str]]

    def _repr_html_(self) -> str:
        return Displayed.html_of(self)
