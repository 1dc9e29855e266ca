"""What was last made of arrays, by their contents."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import numpy as np

_Made = TypeVar("_Made")


class Recent(Generic[_Made]):
    """Results that are determined by some arrays, of which the last ``most`` are kept, for all threads."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._kept: OrderedDict[Hashable, _Made] = OrderedDict()

    def of(self, arrays: tuple[np.ndarray, ...], make: Callable[[], _Made], *others: Hashable) -> _Made:
        """The result for such arrays, and what else it depends on, which is made if it is not kept."""
        key = _digest(arrays), *others
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = make()
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return made


def _digest(arrays: tuple[np.ndarray, ...]) -> bytes:
    found = hashlib.blake2b(digest_size=16)
    for array in arrays:
        found.update(f"{array.dtype} {array.shape} ".encode())
        found.update(array.tobytes())
    return found.digest()
