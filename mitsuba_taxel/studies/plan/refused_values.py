"""Values of a batch that no scene takes, before anything is computed or written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.vary import Axis

MOST_VALUES = 64
"""Of a longer dimension, the words and the least and largest numbers are checked: ranges have two ends."""
MOST_OTHERS = 8
"""Combinations of the other dimensions with which a value is tried, spread evenly, before it is refused."""


def check_values(batch: Batch) -> None:
    """Raise for a value that each scene with it refuses, or a derivative that none has; what only some combinations
    refuse fails there alone.

    Raises
    ------
    InputError
        that names the value, and says what is allowed.
    """
    from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of

    for axis in batch.axes:
        others = [each for each in batch.axes if each is not axis]
        for index in _checked(axis):
            value = {name: words[index] for name, words in axis.values.items()}
            refusal = None
            for rest in _spread(others):
                refusal = refusal_of(batch.scene({**rest, **value}))
                if refusal is None:
                    break
            if refusal is not None:
                shown = ", ".join(f"{name}={word}" for name, word in value.items())
                raise InputError(f"{shown}: {refusal}") from refusal
    check_derivatives(batch)


def check_derivatives(batch: Batch) -> None:
    """Raise if no scene of the batch has one of its derivatives; what only some of them lack fails there alone.

    Raises
    ------
    InputError
        that names the parameter.
    """
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates

    for name in batch.derivatives:
        for values in _spread(batch.axes):
            try:
                rates(batch.scene(values), name)
                break
            except InputError as error:
                refusal = error
        else:
            raise refusal


def _checked(axis: Axis) -> list[int]:
    """Indices along a dimension."""
    if axis.size <= MOST_VALUES:
        return list(range(axis.size))
    indices: set[int] = set()
    for words in axis.values.values():
        numbers = as_numbers(words)
        if numbers is None:
            first = {word: index for index, word in reversed(list(enumerate(words)))}
            indices.update(index for word, index in first.items() if as_numbers([word]) is None)
            numbers = [math.nan if (number := as_numbers([word])) is None else number[0] for word in words]
        if not np.all(np.isnan(numbers)):
            indices.update((int(np.nanargmin(numbers)), int(np.nanargmax(numbers))))
    return sorted(indices)[:MOST_VALUES]


def _spread(axes: Sequence[Axis]) -> Iterator[dict[str, str]]:
    """Some combinations of values, spread evenly."""
    shape = tuple(axis.size for axis in axes)
    count = math.prod(shape)
    for number in dict.fromkeys(np.linspace(0, count - 1, min(count, MOST_OTHERS)).round().astype(int).tolist()):
        places = zip(axes, np.unravel_index(number, shape), strict=True) if axes else ()
        yield {name: words[i] for axis, i in places for name, words in axis.values.items()}
