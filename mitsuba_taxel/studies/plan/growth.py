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
    """Merge a requested batch with the stored study that it extends, so that stored results are used again.

    Values of a varied parameter are merged. If a parameter is varied in only one of the two studies, its fixed value in
    the other study is included. A table of steps may be continued by further rows. The smaller target error, or the
    larger number of points, applies. A batch that does not extend the stored study is returned unchanged.
    """
    before = make_axes(stored.get("vary", {}), stored.get("together"), forces=batch.forces, loads=batch.loads)

    # Each dimension of the stored study is merged with the requested values, or with the requested fixed value.
    fixed, defines = stored["provenance"]["parameters"], dict(batch.defines)
    now = {axis.dim: axis for axis in batch.axes}
    axes = []
    for axis in before:
        if axis.dim not in now and axis.dim not in defines:
            return batch
        requested = now.pop(axis.dim, None) or Axis(axis.dim, {axis.dim: [defines.pop(axis.dim)]})
        joined = _rows(axis, requested) if axis.dim == STEP else _values(axis, requested)
        if joined is None:
            return batch
        axes.append(joined)

    # Each dimension that is new gets the value that was fixed in the stored study.
    for axis in now.values():
        if axis.dim == STEP or axis.dim not in fixed:
            return batch
        axes.append(_values(Axis(axis.dim, {axis.dim: [fixed[axis.dim]]}), axis))
    return replace(batch, axes=tuple(axes), defines=defines, **_better(batch, stored))


def _better(batch: Batch, stored: Mapping[str, Any]) -> dict[str, Any]:
    """Targets of an extended study: those of the stored study if the batch has none, else the stricter ones."""
    if all(getattr(batch, name) is None for name in (*TARGETS, "time_budget")):
        return {name: stored.get(name) for name in TARGETS}
    both = [name for name in TARGETS if getattr(batch, name) is not None and name in stored]
    return {name: (max if name == "points" else min)(getattr(batch, name), stored[name]) for name in both}


def _rows(before: Axis, requested: Axis) -> Axis | None:
    """Merge two dimensions of rows: the longer one if it starts with the rows of the shorter one, else None."""
    longer, shorter = sorted((before, requested), key=lambda axis: axis.size, reverse=True)
    if longer.values.keys() != shorter.values.keys():
        return None
    same = all(_keys(longer.values[name])[: len(words)] == _keys(words) for name, words in shorter.values.items())
    return longer if same else None


def _values(before: Axis, requested: Axis) -> Axis:
    """Merge the values of two dimensions. Values that are stored keep their text, because it names their results."""
    old, new = before.values[before.dim], requested.values[requested.dim]
    stored_words = dict(zip(_keys(old), old, strict=True))
    # The request holds all stored values: it determines the order.
    if stored_words.keys() <= set(_keys(new)):
        merged = [stored_words.get(key, word) for key, word in zip(_keys(new), new, strict=True)]
        return Axis(
            before.dim,
            {before.dim: merged},
            is_force=before.is_force or requested.is_force,
            is_load=before.is_load or requested.is_load,
        )

    # Stored values come first, then new ones; they are sorted if both were monotonic.
    joined = old + [word for key, word in zip(_keys(new), new, strict=True) if key not in stored_words]
    numbers = as_numbers(joined)
    if numbers and all(_is_monotonic(as_numbers(words)) for words in (old, new)):
        falls = any(words[-1] < words[0] for words in map(as_numbers, (old, new)) if words)
        joined = [joined[index] for index in np.argsort(numbers, kind="stable")]
        joined = joined[::-1] if falls else joined
    return Axis(
        before.dim,
        {before.dim: joined},
        is_force=before.is_force or requested.is_force,
        is_load=before.is_load or requested.is_load,
    )


def _is_monotonic(numbers: Sequence[float] | None) -> bool:
    """Whether a sequence of numbers is strictly increasing or strictly decreasing."""
    steps = np.diff(numbers or [])
    return bool(np.all(steps > 0) or np.all(steps < 0))


def _keys(words: Sequence[str]) -> list[Any]:
    """Keys for comparing values given as text: numbers, so that 1 equals 1.0, or else the text itself."""
    return [number[0] if (number := as_numbers([word])) else word for word in words]


def without_failed(stored: Mapping[str, Any], batch: Batch, done: Set[int], failed: Set[int]) -> dict[str, Any]:
    """Remove, from a stored study, varied values without any result that are not requested again.

    A value is removed if none of its scenes has a result, the requested batch does not contain it, and either one of
    its scenes has failed or it is text among numbers.

    Parameters
    ----------
    stored : Mapping[str, Any]
        Content of the stored study file.
    batch : Batch
        The requested study.
    done, failed : Set[int]
        Numbers of the stored jobs with a result, and with a failure.

    Returns
    -------
    dict[str, Any]
        The stored content with a reduced table ``vary``.
    """
    # For each dimension, the indices of values with a result and with a failure.
    axes = make_axes(stored.get("vary", {}), stored.get("together"))
    shape = tuple(axis.size for axis in axes)
    numbers = (np.array([number for number in jobs if number < prod(shape)], dtype=int) for jobs in (done, failed))
    reached, stopped = ([set(along.tolist()) for along in np.unravel_index(flat, shape)] for flat in numbers)

    # Values with a result, requested values, and values that may still be computed are kept.
    requested = {axis.dim: axis.values[axis.dim] for axis in batch.axes if axis.dim != STEP}
    requested |= {name: [word] for name, word in batch.defines.items()}
    vary = {}
    for dimension, axis in enumerate(axes):
        if axis.dim == STEP:
            continue
        words, requested_words = axis.values[axis.dim], requested.get(axis.dim, [])
        keys, numeric = set(_keys(requested_words)), bool(requested_words) and as_numbers(requested_words) is not None
        vary[axis.dim] = [
            word
            for index, (key, word) in enumerate(zip(_keys(words), words, strict=True))
            if index in reached[dimension]
            or key in keys
            or not (index in stopped[dimension] or (numeric and isinstance(key, str)))
        ]
    return {**stored, "vary": vary}


def moves(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[int, int | None] | None:
    """Renumber the jobs of a stored study that is extended by further values: the new number of each old number.

    Parameters
    ----------
    before, now : Mapping[str, Any]
        Contents of the stored and of the extended study file, with their provenance.

    Returns
    -------
    dict[int, int or None] or None
        New number by old number; None for a job that the extended study does not contain. None instead of the
        dictionary if the studies differ in a setting that an extension must not change.
    """
    kept = [
        {name: value for name, value in study.items() if name not in (*GROWING, "provenance")}
        for study in (before, now)
    ]
    origins = [{**study["provenance"], "parameters": None} for study in (before, now)]
    if kept[0] != kept[1] or origins[0] != origins[1]:
        return None
    old, new = _parameters(before), _parameters(now)
    new_numbers = {frozenset(parameters.items()): number for number, parameters in enumerate(new)}
    return {number: new_numbers.get(frozenset(parameters.items())) for number, parameters in enumerate(old)}


def _parameters(study: Mapping[str, Any]) -> list[dict[str, str]]:
    """Values of all parameters of each job of a study, in the order of the jobs."""
    axes = make_axes(study.get("vary", {}), study.get("together"))
    return [{**study["provenance"]["parameters"], **values} for _, values in combinations(axes)]
