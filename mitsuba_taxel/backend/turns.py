"""One thread at a time in Mitsuba: the recording of Dr.Jit's kernels and the registered plugins are shared by all
threads of a process.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

_LOCK = threading.RLock()


def in_turn(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorator that guards a function by the process's lock for Mitsuba: only one decorated function runs at a time.

    Calls from other threads wait. A decorated function may call another decorated function.

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
