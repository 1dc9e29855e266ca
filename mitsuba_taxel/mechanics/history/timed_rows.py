"""Values of a load with their times, for silicones and loads whose states depend on earlier states."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import overload

import numpy as np

from mitsuba_taxel.base.arguments import array_of, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.mullins import Mullins
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic

DIGEST_SIZE = 32
"""Bytes of a history's digest."""


def rubs(load: Load) -> bool:
    """Whether a load is an indenter with friction, so that its states depend on earlier states.

    Parameters
    ----------
    load : Load
        Load of any kind.

    Returns
    -------
    bool
        True if it has friction.
    """
    return load.indenter is not None and load.indenter.friction > 0


Row = tuple[float, tuple[float, ...]]
"""Time in s, and value of the load."""


class LoadHistory:
    """Values of a load with their times (rows). Each row has a digest of all rows up to and including itself.

    The first rows of a history, ``history[:count]``, are shared with it, so the histories of all states of a path take
    time and memory in proportion to their number. Histories are equal if their rows are equal.

    Parameters
    ----------
    rows : Iterable[Row]
        Rows in the order of their times.
    """

    __slots__ = ("_count", "_digests", "_rows")

    def __init__(self, rows: Iterable[Row] = ()) -> None:
        self._rows, self._digests = tuple(rows), [bytes(DIGEST_SIZE)]
        self._count = len(self._rows)
        for row in self._rows:
            chained = hashlib.blake2b(self._digests[-1], digest_size=DIGEST_SIZE)
            chained.update(np.array([row[0], *row[1]]).tobytes())
            self._digests.append(chained.digest())

    @property
    def digest(self) -> bytes:
        """Digest of all rows, to the last bit."""
        return self._digests[self._count]

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, key: int) -> Row: ...
    @overload
    def __getitem__(self, key: slice) -> LoadHistory: ...

    def __getitem__(self, key: int | slice) -> Row | LoadHistory:
        if not isinstance(key, slice):
            return self._rows[range(self._count)[key]]
        start, stop, step = key.indices(self._count)
        if (start, step) != (0, 1):
            raise IndexError("only the first rows of a history can be selected: history[:count]")
        rows = object.__new__(LoadHistory)
        rows._rows, rows._digests, rows._count = self._rows, self._digests, stop
        return rows

    def __iter__(self) -> Iterator[Row]:
        return islice(self._rows, self._count)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LoadHistory) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


def timed_rows(
    material: Material | Viscoelastic | Mullins, load: Load, values: np.ndarray, times: object
) -> LoadHistory:
    """The history of a load. It is empty if states depend only on the present value of the load.

    For friction on an elastic material, and for Mullins' effect, all rows are at 0 s, and the load first acts along z,
    then sideways.

    Parameters
    ----------
    material : Material or Viscoelastic or Mullins
        Material of the pad.
    load : Load
        Load whose values are ``values``.
    values : (n, components) ndarray
        Values in N, mm or MPa.
    times : (n,) array_like or None
        Times of the values in s, in ascending order; None if the material is elastic.

    Returns
    -------
    LoadHistory
        A row for each value; under friction, with one more row at the start.

    Raises
    ------
    InputError
        if times are missing, not needed or not allowed, or a value is not allowed.
    """
    if not isinstance(material, Viscoelastic):
        if times is not None:
            raise refusal("times", times, f"{material} does not depend on time, only a Viscoelastic does")
        softens = isinstance(material, Mullins)
        if not (rubs(load) or softens):
            return LoadHistory()
        if softens and load.tilts:
            raise InputError(
                f"load = {load.name!r} is not allowed with Mullins' effect: memory under a tilting plate is not "
                "modelled; remove mullins, or use a load without moments."
            )
        for value in values:
            load.check(value)
        sideways = len(values[0]) == 3 and values[0][:2].any()
        first = [(0.0, 0.0, values[0][2])] if sideways else []
        return LoadHistory((0.0, tuple(map(float, value))) for value in [*first, *values])
    if load.tilts:
        raise InputError(
            f"load = {load.name!r} is not allowed with a viscoelastic silicone: memory under a tilting plate is not "
            "modelled; remove prony, or use a load without moments."
        )
    if times is None:
        raise InputError("times are missing: a viscoelastic silicone needs the time of each value of its load.")
    for value in values:
        load.check(value)
    when = array_of("times", times, (len(values),))
    before = np.concatenate([[0.0], when[:-1]])
    wrong = np.flatnonzero(when < before)
    if len(wrong):
        number = wrong[0]
        raise InputError(
            f"times[{number}] = {when[number]:g} s is not allowed: at least {before[number]:g} s is needed."
        )
    return LoadHistory((float(time), tuple(map(float, value))) for time, value in zip(when, values, strict=True))


def rate_is_new(rows: LoadHistory) -> bool:
    """Whether the rate of the load changed at the start of the last row. If it did, the next rate may last for one row
    only, too.
    """
    if not rows or rows[-1][0] == (rows[-2][0] if len(rows) > 1 else 0.0):
        return False  # no rate yet, or a jump
    points = [(0.0, np.zeros(len(rows[0][1]))), *(rows[k] for k in range(max(len(rows) - 3, 0), len(rows)))][-3:]
    if len(points) < 3:
        return True
    times, values = np.array([time for time, _ in points]), np.array([value for _, value in points])
    (first, second), (before, after) = np.diff(times), np.diff(values, axis=0)
    return not np.allclose(before * second, after * first, rtol=1e-9, atol=0)
