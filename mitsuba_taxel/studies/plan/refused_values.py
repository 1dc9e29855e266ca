"""Refusal of values that no scene of a batch accepts, before anything is computed or written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.vary import Axis

MOST_VALUES = 64
"""Largest dimension whose values are all checked. In a longer one, words and the two extreme numbers are checked."""
MOST_OTHERS = 8
"""Number of combinations of the other dimensions, spread evenly, that must all refuse a value."""


def check_values(batch: Batch) -> None:
    """Refuse a batch with a value that is invalid in every combination, or with a derivative that no scene provides.

    A value that is invalid in some combinations only is allowed: these scenes fail, and the others are computed.

    Raises
    ------
    InputError
        if there is such a value or derivative; the message names it and says what is allowed.
    """
    from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of

    for axis in batch.axes:
        other_axes = [dimension for dimension in batch.axes if dimension is not axis]
        for index in _checked(axis):
            value = {name: words[index] for name, words in axis.values.items()}
            refusal = None
            for rest in _spread(other_axes):
                refusal = refusal_of(batch.scene({**rest, **value}))
                if refusal is None:
                    break
            if refusal is not None:
                shown = ", ".join(f"{name}={word}" for name, word in value.items())
                raise InputError(f"{shown}: {refusal}") from refusal
    check_derivatives(batch)


def check_derivatives(batch: Batch) -> None:
    """Refuse a batch with a derivative that no scene provides.

    If only some scenes do not provide it, their jobs fail when they are computed.

    Raises
    ------
    InputError
        if there is such a derivative; the message names its parameter.
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
    """Indices of the values along a dimension that are tested: all values or, for a long dimension, words and the
    extreme numbers."""
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
    """Combinations of values by parameter, at most `MOST_OTHERS`, spread evenly over the dimensions."""
    shape = tuple(axis.size for axis in axes)
    count = math.prod(shape)
    for number in dict.fromkeys(np.linspace(0, count - 1, min(count, MOST_OTHERS)).round().astype(int).tolist()):
        positions = zip(axes, np.unravel_index(number, shape), strict=True) if axes else ()
        yield {name: words[i] for axis, i in positions for name, words in axis.values.items()}
