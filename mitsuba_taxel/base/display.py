"""Display of objects in notebooks. Another package supplies the HTML, because it imports the packages of the objects.
"""

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
