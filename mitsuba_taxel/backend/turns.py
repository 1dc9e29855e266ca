"""Serialise access to Mitsuba: Dr.Jit's recording and the registered plugins are state of the process, and so are
signals that would interrupt their import."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

_LOCK = threading.RLock()


def in_turn(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate functions of which only one may run at a time, in any thread; others wait.

    Parameters
    ----------
    function : Callable
        Of any arguments.

    Returns
    -------
    Callable
        Of the same arguments.
    """

    @wraps(function)
    def alone(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _LOCK:
            return function(*args, **kwargs)

    return alone


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Signals of this thread that end the process wait until the end: Mitsuba and Dr.Jit, half imported, abort it.

    Yields
    ------
    None
        While signals wait.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
