"""Suggestions for misspelt names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A suggestion for an unknown name.

    Parameters
    ----------
    name : str
        The unknown name.
    known : iterable of str
        Allowed names.

    Returns
    -------
    str
        Text such as " (did you mean pitch?)"; empty if no allowed name is similar.
    """
    close = get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]}?)" if close else ""
