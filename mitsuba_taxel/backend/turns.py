"""Serialised access to Mitsuba: the recording of Dr.Jit and the registered plugins are state of the process."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

_LOCK = threading.RLock()


def in_turn(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorator of functions of which only one may run at a time, in any thread; calls wait for each other.

    Parameters
    ----------
    function : Callable
        Function of any arguments.

    Returns
    -------
    Callable
        Function of the same arguments.
    """

    @wraps(function)
    def serialised(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _LOCK:
            return function(*args, **kwargs)

    return serialised
