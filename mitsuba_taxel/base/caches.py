"""What is kept between calls, in one place: each cache has a name, a size, and can be emptied."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

_Made = TypeVar("_Made")
_Function = TypeVar("_Function", bound=Callable[..., Any])


class CacheSize(NamedTuple):
    """Entries that a cache holds, and the most that it keeps; None without a limit."""

    held: int
    most: int | None


class _Cache(Protocol):
    def clear(self) -> None: ...
    def size(self) -> CacheSize: ...


_CACHES: dict[str, _Cache] = {}


def kept(most: int | None) -> Callable[[_Function], _Function]:
    """Decorator of a function or a class whose last ``most`` results are kept, by the values of its arguments.

    It is `functools.lru_cache`, known to :func:`clear_caches` under the name of the function.

    Parameters
    ----------
    most : int or None
        Results that are kept; None for all.

    Returns
    -------
    Callable
        The decorator.
    """

    def keep(function: _Function) -> _Function:
        wrapped: Any = lru_cache(maxsize=most)(function)
        _CACHES[f"{function.__module__}.{function.__qualname__}"] = _OfFunction(wrapped)
        return wrapped

    return keep


class _OfFunction:
    def __init__(self, wrapped: Any) -> None:
        self.clear = wrapped.cache_clear
        self._info = wrapped.cache_info

    def size(self) -> CacheSize:
        info = self._info()
        return CacheSize(info.currsize, info.maxsize)


class Recent(Generic[_Made]):
    """Results that are determined by some arrays, of which the last ``most`` are kept, for all threads.

    Parameters
    ----------
    name : str
        Under which :func:`cache_sizes` lists it.
    most : int
    """

    def __init__(self, name: str, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._held: OrderedDict[Hashable, _Made] = OrderedDict()
        _CACHES[name] = self

    def of(self, arrays: tuple[np.ndarray, ...], make: Callable[[], _Made], *others: Hashable) -> _Made:
        """The result for such arrays, and what else it depends on, which is made if it is not kept."""
        key = _digest(arrays), *others
        with self._lock:
            if key in self._held:
                self._held.move_to_end(key)
                return self._held[key]
        made = make()
        with self._lock:
            self._held[key] = made
            while len(self._held) > self._most:
                self._held.popitem(last=False)
        return made

    def clear(self) -> None:
        """Forget all results."""
        with self._lock:
            self._held.clear()

    def size(self) -> CacheSize:
        """Entries held, and the most that are."""
        return CacheSize(len(self._held), self._most)


def cache_sizes() -> dict[str, CacheSize]:
    """Entries of all caches in memory, by name."""
    return {name: cache.size() for name, cache in sorted(_CACHES.items())}


def clear_caches(*functions: Callable[..., Any]) -> None:
    """Empty the caches of some functions, by default all caches in memory: meshes, load paths, factors, tables.

    What was kept is computed again when it is needed.

    Parameters
    ----------
    *functions : Callable
        Decorated by :func:`kept`.
    """
    for function in functions:
        cache: Any = function
        cache.cache_clear()
    for every in [] if functions else list(_CACHES.values()):
        every.clear()


def _digest(arrays: tuple[np.ndarray, ...]) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.digest()
