"""The current activity of a long computation, for progress displays."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[str], None]] = []
_current: list[str] = []
"""Activities in progress, of all threads; the last is shown."""


@contextmanager
def activity(words: str) -> Iterator[None]:
    """Announce an activity, such as ``meshing pad.stl``, while the block runs.

    Parameters
    ----------
    words : str
        Description of the activity, without a full stop.

    Yields
    ------
    None
        Nothing, during the activity.
    """
    _current.append(words)
    _announce()
    try:
        yield
    finally:
        _current.remove(words)
        _announce()


@contextmanager
def announced_to(listener: Callable[[str], None]) -> Iterator[None]:
    """Call a listener at each change of activity while the block runs.

    Parameters
    ----------
    listener : Callable[[str], None]
        Called with the current activity, or an empty text if there is none, on the thread of that activity.

    Yields
    ------
    None
        Nothing, while activities are announced.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def _announce() -> None:
    """Call all listeners with the current activity."""
    for listener in _listeners:
        listener(_current[-1] if _current else "")
