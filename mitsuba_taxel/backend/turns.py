"""Serialise access to Mitsuba: Dr.Jit's recording and the registered plugins are state of the process."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

_LOCK = threading.RLock()


def in_turn(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate functions of which only one may run at a time, in any thread; others wait."""

    @wraps(function)
    def alone(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _LOCK:
            return function(*args, **kwargs)

    return alone
