"""Caches that keep results between calls: each has a name and a size, and can be cleared."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

_Result = TypeVar("_Result")
_Function = TypeVar("_Function", bound=Callable[..., Any])


class CacheSize(NamedTuple):
    """Number of entries of a cache, and its maximum; None without a limit."""

    entries: int
    maximum: int | None


class _Cache(Protocol):
    def clear(self) -> None: ...
    def size(self) -> CacheSize: ...


_CACHES: dict[str, _Cache] = {}


def kept(maximum: int | None) -> Callable[[_Function], _Function]:
    """Decorator that caches the most recent results of a function or class by the values of its arguments.

    The decorator is `functools.lru_cache`; it also registers the cache for :func:`clear_caches` under the name of the
    function.

    Parameters
    ----------
    maximum : int or None
        Number of results in the cache; None for no limit.

    Returns
    -------
    Callable
        The decorator.
    """

    def keep(function: _Function) -> _Function:
        wrapped: Any = lru_cache(maxsize=maximum)(function)
        _CACHES[f"{function.__module__}.{function.__qualname__}"] = _OfFunction(wrapped)
        return wrapped

    return keep


class _OfFunction:
    """Cache of a function that is decorated by :func:`kept`."""

    def __init__(self, wrapped: Any) -> None:
        self.clear = wrapped.cache_clear
        self._info = wrapped.cache_info

    def size(self) -> CacheSize:
        info = self._info()
        return CacheSize(info.currsize, info.maxsize)


class Recent(Generic[_Result]):
    """A cache of results that are computed from arrays. All threads share it, and the results that were used least
    recently are removed first.

    Parameters
    ----------
    name : str
        Name in :func:`cache_sizes`.
    maximum : int
        Number of results in the cache.
    """

    def __init__(self, name: str, maximum: int) -> None:
        self._maximum, self._lock = maximum, threading.Lock()
        self._entries: OrderedDict[Hashable, _Result] = OrderedDict()
        _CACHES[name] = self

    def of(self, arrays: tuple[np.ndarray, ...], make: Callable[[], _Result], *others: Hashable) -> _Result:
        """The cached result for arrays and other arguments; if there is none, it is computed by ``make`` and cached.

        Parameters
        ----------
        arrays : tuple of ndarray
            Arrays that determine the result.
        make : Callable
            Function without arguments that computes the result.
        *others : Hashable
            Other values that determine the result.

        Returns
        -------
        object
            The cached result of an earlier call with equal arrays and values, or else the result of ``make``.
        """
        key = _digest(arrays), *others
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
                return self._entries[key]
        result = make()
        with self._lock:
            self._entries[key] = result
            while len(self._entries) > self._maximum:
                self._entries.popitem(last=False)
        return result

    def clear(self) -> None:
        """Remove all results from the cache."""
        with self._lock:
            self._entries.clear()

    def size(self) -> CacheSize:
        """Number of results, and its maximum."""
        return CacheSize(len(self._entries), self._maximum)


def cache_sizes() -> dict[str, CacheSize]:
    """Sizes of all caches in memory, by name."""
    return {name: cache.size() for name, cache in sorted(_CACHES.items())}


def clear_caches(*functions: Callable[..., Any]) -> None:
    """Clear the caches of the given functions; by default, all caches in memory (meshes, load paths, factors, tables).

    Parameters
    ----------
    *functions : Callable
        Functions that are decorated by :func:`kept`.
    """
    for function in functions:
        cache: Any = function
        cache.cache_clear()
    for entry in [] if functions else list(_CACHES.values()):
        entry.clear()


def _digest(arrays: tuple[np.ndarray, ...]) -> bytes:
    """Digest of types, shapes and values of arrays."""
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.digest()
