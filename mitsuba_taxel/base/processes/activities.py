"""What a long computation is doing at the moment, for those that show it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[str], None]] = []
_current: list[str] = []
"""The activities that have begun, of all threads; the last one is shown."""


@contextmanager
def activity(words: str) -> Iterator[None]:
    """Announce what is done within, such as ``meshing pad.stl``.

    Parameters
    ----------
    words : str
        What is done, without a full stop.

    Yields
    ------
    None
        While it is done.
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
    """Call ``listener`` with each activity that begins within, and with an empty text where none is left.

    Parameters
    ----------
    listener : Callable[[str], None]
        Called on the thread that begins the activity.

    Yields
    ------
    None
        While activities are announced.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def _announce() -> None:
    for listener in _listeners:
        listener(_current[-1] if _current else "")
