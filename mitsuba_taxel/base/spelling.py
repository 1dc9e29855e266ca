"""Names that were probably meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A suggestion for an unknown name, in brackets after a space; empty if no known one is close.

    Parameters
    ----------
    name : str
        The unknown one.
    known : iterable of str
        Names that are allowed.

    Returns
    -------
    str
        Such as " (did you mean pitch?)".
    """
    close = get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]}?)" if close else ""
