"""Extension of stored studies: new values are added to those of a folder, and a stricter target replaces the old
one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.vary import STEP, Axis, combinations, make_axes

GROWING = ("vary", "together", "define", "target_error", "target_slope", "points", "time_budget", "meshes")
"""Tables and values of a stored study that may change when it is extended."""
TARGETS = ("target_error", "target_slope", "points")


def grown(batch: Batch, stored: Mapping[str, Any]) -> Batch:
    """The batch, extended by the values of a stored study of the same scene.

    Values of a varied parameter are merged, including its fixed value where it is varied in only one of the two; rows
    of values taken together may be continued. Of two target errors, or numbers of points, the stricter one counts. A
    batch that does not extend the stored study is returned unchanged.
    """
    before = make_axes(stored.get("vary", {}), stored.get("together"), forces=batch.forces, loads=batch.loads)
    fixed, defines = stored["provenance"]["parameters"], dict(batch.defines)
    now = {axis.dim: axis for axis in batch.axes}
    axes = []
    for axis in before:
        if axis.dim not in now and axis.dim not in defines:
            return batch
        asked = now.pop(axis.dim, None) or Axis(axis.dim, {axis.dim: [defines.pop(axis.dim)]})
        joined = _rows(axis, asked) if axis.dim == STEP else _values(axis, asked)
        if joined is None:
            return batch
        axes.append(joined)
    for axis in now.values():
        if axis.dim == STEP or axis.dim not in fixed:
            return batch
        axes.append(_values(Axis(axis.dim, {axis.dim: [fixed[axis.dim]]}), axis))
    return replace(batch, axes=tuple(axes), defines=defines, **_better(batch, stored))


def _better(batch: Batch, stored: Mapping[str, Any]) -> dict[str, Any]:
    """The stricter of the targets that both have; the stored one where none is requested."""
    if all(getattr(batch, name) is None for name in (*TARGETS, "time_budget")):
        return {name: stored.get(name) for name in TARGETS}
    both = [name for name in TARGETS if getattr(batch, name) is not None and name in stored]
    return {name: (max if name == "points" else min)(getattr(batch, name), stored[name]) for name in both}


def _rows(before: Axis, asked: Axis) -> Axis | None:
    """The longer of two dimensions of rows, if it starts with the rows of the other."""
    longer, shorter = sorted((before, asked), key=lambda axis: axis.size, reverse=True)
    if longer.values.keys() != shorter.values.keys():
        return None
    same = all(_keys(longer.values[name])[: len(words)] == _keys(words) for name, words in shorter.values.items())
    return longer if same else None


def _values(before: Axis, asked: Axis) -> Axis:
    """The values of both dimensions, stored ones as they were written."""
    old, new = before.values[before.dim], asked.values[asked.dim]
    known = dict(zip(_keys(old), old, strict=True))
    if known.keys() <= set(_keys(new)):
        merged = [known.get(key, word) for key, word in zip(_keys(new), new, strict=True)]
        return Axis(
            before.dim,
            {before.dim: merged},
            is_force=before.is_force or asked.is_force,
            is_load=before.is_load or asked.is_load,
        )
    joined = old + [word for key, word in zip(_keys(new), new, strict=True) if key not in known]
    numbers = as_numbers(joined)
    if numbers and all(_one_way(as_numbers(words)) for words in (old, new)):
        falls = any(words[-1] < words[0] for words in map(as_numbers, (old, new)) if words)
        joined = [joined[place] for place in np.argsort(numbers, kind="stable")]
        joined = joined[::-1] if falls else joined
    return Axis(
        before.dim,
        {before.dim: joined},
        is_force=before.is_force or asked.is_force,
        is_load=before.is_load or asked.is_load,
    )


def _one_way(numbers: Sequence[float] | None) -> bool:
    steps = np.diff(numbers or [])
    return bool(np.all(steps > 0) or np.all(steps < 0))


def _keys(words: Sequence[str]) -> list[Any]:
    """Keys for comparing words: numbers where they are numbers."""
    return [number[0] if (number := as_numbers([word])) else word for word in words]


def without_failed(stored: Mapping[str, Any], batch: Batch, done: Set[int], failed: Set[int]) -> dict[str, Any]:
    """A stored study without the values of its varied parameters that lead nowhere: none of their scenes has a result,
    the batch does not ask for them, and one of their scenes has failed, or they are words among numbers.

    Parameters
    ----------
    done, failed : Set[int]
        Numbers of the stored jobs.
    """
    axes = make_axes(stored.get("vary", {}), stored.get("together"))
    shape = tuple(axis.size for axis in axes)
    numbers = (np.array([number for number in jobs if number < prod(shape)], dtype=int) for jobs in (done, failed))
    reached, stopped = ([set(along.tolist()) for along in np.unravel_index(each, shape)] for each in numbers)
    asked = {axis.dim: axis.values[axis.dim] for axis in batch.axes if axis.dim != STEP}
    asked |= {name: [word] for name, word in batch.defines.items()}
    vary = {}
    for place, axis in enumerate(axes):
        if axis.dim == STEP:
            continue
        words, wanted = axis.values[axis.dim], asked.get(axis.dim, [])
        keys, numeric = set(_keys(wanted)), bool(wanted) and as_numbers(wanted) is not None
        vary[axis.dim] = [
            word
            for index, (key, word) in enumerate(zip(_keys(words), words, strict=True))
            if index in reached[place]
            or key in keys
            or not (index in stopped[place] or (numeric and isinstance(key, str)))
        ]
    return {**stored, "vary": vary}


def moves(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[int, int | None] | None:
    """New numbers of the jobs of a stored study, by their old numbers, None for those that the new one does not hold;
    None if it is another study.

    Both are contents of study files in folders of results.
    """
    kept = [
        {name: value for name, value in one.items() if name not in (*GROWING, "provenance")} for one in (before, now)
    ]
    origins = [{**one["provenance"], "parameters": None} for one in (before, now)]
    if kept[0] != kept[1] or origins[0] != origins[1]:
        return None
    old, new = _parameters(before), _parameters(now)
    places = {frozenset(parameters.items()): number for number, parameters in enumerate(new)}
    return {number: places.get(frozenset(parameters.items())) for number, parameters in enumerate(old)}


def _parameters(study: Mapping[str, Any]) -> list[dict[str, str]]:
    """All parameters of each job."""
    axes = make_axes(study.get("vary", {}), study.get("together"))
    return [{**study["provenance"]["parameters"], **values} for _, values in combinations(axes)]
