"""Ranking of variants of a sensor by a figure of merit, with probabilities."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.characteristics import DEVIATIONS, SLOPES, characteristics, rows_of
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.shape_error import VARIANTS, Mode, besides_shape, changed_by_shape, shape_shift
from mitsuba_taxel.characterise.summary import common_channel
from mitsuba_taxel.characterise.volts import volts_table
from mitsuba_taxel.electronics import Circuit, in_volts, saturation_force
from mitsuba_taxel.electronics.noise import resolution_notes
from mitsuba_taxel.electronics.volts import circuit_of_study

if TYPE_CHECKING:
    import pandas

FIGURES = (*SLOPES, *DEVIATIONS)
NEEDS = {
    "nonlinearity": "three forces",
    "zero_slope": "forces near zero",
    "hysteresis": "growing and falling forces",
    "repeatability": "two cycles",
}
SLACK = 1 + 1e-9
"""Factor that absorbs rounding where a force is compared with a limit."""
WITHIN = 0.5
"""Least probability of meeting the limits with which a variant counts as within them."""
MOST_NAMED = 5
"""Largest number of saturated variants that a message names."""
DRAWS = 20_000
"""Random draws for the probabilities, which are then accurate to 0.4 percentage points."""


class Comparison(NamedTuple):
    """Variants in the order of their ranks, with probabilities.

    If no variant meets the limits with a probability of at least one half, no variant has a rank, and ``behind`` is
    NaN.

    Attributes
    ----------
    table : pandas.DataFrame
        A row for each variant: ``rank``; the parameters in which the variants differ; a column for each figure and its
        ``_error``; ``allowed``, the probability that the variant meets the limits; ``first``, the probability that it
        is the best of the variants that meet them; ``behind``, the difference from the first variant, and
        ``behind_error``.
    by : str
        The figure by which variants are ranked.
    limits : dict[str, float]
        Largest allowed magnitudes of figures, in their units.
    unit : dict[str, str]
        Unit of each figure.
    channel : str
        Name of the channel that represents all taxels (see `common_channel`); empty for a single taxel.
    volts : pandas.DataFrame or None
        The ``volts_table`` of all studies; None without a circuit.
    notes : list[str]
        Remarks for readers of the table.
    """

    table: pandas.DataFrame
    by: str
    limits: dict[str, float]
    unit: dict[str, str]
    channel: str
    volts: pandas.DataFrame | None
    notes: list[str]

    @property
    def ranked(self) -> bool:
        """Whether any variant is within the limits, so that there is a ranking."""
        return bool(self.table["rank"].notna().all())


class _Variant(NamedTuple):
    """A variant of the sensor and its readings along the force.

    ``where`` holds the parameters of the variant. ``changed`` holds the readings changed by each independent component
    (mode) of the errors of the shape. ``numbers`` (seed, points, replicates) determines its random numbers.
    ``saturated`` is the least magnitude of the force in N at which a taxel saturates.
    """

    where: dict[str, Any]
    reading: Experiment
    changed: dict[Mode, list[Experiment]]
    numbers: tuple[Any, ...]
    saturated: float = math.inf


def compare(
    studies: Mapping[str, xr.Dataset | xr.DataTree],
    by: str = "relative_slope",
    at_most: Mapping[str, float] | None = None,
    *,
    force: str | None = None,
    up_to: float | None = None,
    circuit: Circuit | None = None,
) -> Comparison:
    """Rank the variants of a sensor in studies by a figure of merit, with probabilities.

    A variant is a combination of all parameters except the force. An array of taxels is represented by one channel (see
    `common_channel`). Slopes are ranked by magnitude, the largest first; deviations are ranked the smallest first.

    Errors are those of ``taxel characterise``. Variants with the same seed and number of points share their random
    numbers; the jackknife over replicates gives the error of their difference, in which common noise cancels. Errors of
    mechanics and geometry have a correlation of 0.88 between variants that differ in numerical parameters only; between
    other variants and between scenes they are independent.

    Readings are in volts with a circuit, otherwise in watts. A variant that saturates within the range of forces is not
    ranked, because its figures are then determined by the circuit.

    Parameters
    ----------
    studies : Mapping[str, xr.Dataset or xr.DataTree]
        Studies by a unique name.
    by : str
        Figure by which to rank: max_slope, mean_slope, zero_slope, relative_slope, nonlinearity, hysteresis or
        repeatability.
    at_most : Mapping[str, float], optional
        Largest allowed magnitudes, by figure: in % for nonlinearity, hysteresis and repeatability, in %/N for
        relative_slope, and in W/N (V/N behind a circuit) for the other slopes.
    force : str, optional
        Force along which to compare, if the studies vary several.
    up_to : float, optional
        Largest force in N that is used; variants that do not reach it are left out.
    circuit : Circuit, optional
        Circuit for all readings, instead of the circuits of the studies.

    Returns
    -------
    Comparison
        A table of the variants, the best first.

    Raises
    ------
    InputError
        if there are fewer than two variants, if all saturate or lack a figure, or if only some of the studies have a
        circuit.
    """
    import pandas

    limits = dict(at_most or {})
    for name in (by, *limits):
        if name not in FIGURES:
            raise InputError(f"figure {name!r} is not known: one of {', '.join(FIGURES)} is needed.")

    # Variants along one force, within its range, unsaturated, with one channel each.
    notes: list[str] = []
    circuits = _circuits(studies, circuit)
    variants = _in_range(_along(list(_variants(studies, circuits)), force), up_to, notes)
    if len(variants) < 2:
        raise InputError(
            f"a comparison needs at least two variants along a force, and the studies hold {len(variants)}; vary a "
            f"parameter besides the force."
        )
    variants = _unsaturated(variants, up_to, notes)
    variants, channel = _one_channel(variants)

    # Random draws of all figures (draws, figures, variants) with their errors and correlations.
    names = list(dict.fromkeys([by, *limits]))
    value, light, shape_shifts, units = _figures(variants, names)
    covariance = _covariance(variants, names, light, shape_shifts)
    random = np.random.default_rng(0)
    drawn = random.multivariate_normal(value.ravel(), covariance, DRAWS, method="eigh").reshape(DRAWS, *value.shape)

    # Probabilities to meet the limits, and to be the best variant that meets them.
    allowed = np.ones((DRAWS, len(variants)), dtype=bool)
    for name, limit in limits.items():
        allowed &= np.abs(drawn[:, names.index(name)]) <= limit
    score = np.where(allowed, _score(by, drawn[:, 0]), -np.inf)
    first = np.bincount(score.argmax(axis=1)[allowed.any(axis=1)], minlength=len(variants)) / DRAWS
    meets_limits = allowed.mean(axis=0)

    # Variants within the limits rank first, by their figure. If there are none, the probability to meet them counts.
    within = meets_limits >= WITHIN
    order = np.lexsort((-_score(by, value[0]), ~within if within.any() else -meets_limits))
    table = _table(variants, names, value, covariance, meets_limits, first, order)
    if not within.any():
        table = table.assign(
            rank=pandas.array([pandas.NA] * len(table), dtype="Int64"), behind=np.nan, behind_error=np.nan
        )
    volts = _volts(studies, circuits, force, up_to, notes) if circuits else None
    return Comparison(table, by, limits, units, channel, volts, notes)


def _score(by: str, value: np.ndarray) -> np.ndarray:
    """Score of a variant for the ranking; larger is better. It is the magnitude of a slope, or the negative of a
    deviation."""
    return -value if by in DEVIATIONS else np.abs(value)


def _circuits(studies: Mapping[str, xr.Dataset | xr.DataTree], circuit: Circuit | None) -> dict[str, Circuit]:
    """The circuit behind each study; empty if there is none."""
    of_study = {name: circuit or circuit_of_study(study) for name, study in studies.items()}
    circuits = {name: value for name, value in of_study.items() if value is not None}
    if circuits and len(circuits) < len(of_study):
        without = next(name for name in of_study if name not in circuits)
        raise InputError(
            f"{next(iter(circuits))} in volts and {without} in watts cannot be compared: give a circuit "
            "for all studies, or for none."
        )
    return circuits


def _volts(
    studies: Mapping[str, xr.Dataset | xr.DataTree],
    circuits: Mapping[str, Circuit],
    force: str | None,
    up_to: float | None,
    notes: list[str],
) -> pandas.DataFrame:
    """Circuit figures (see `volts_table`) of all studies along the compared force. A note is added if converter steps
    hide the noise."""
    import pandas

    tables = [
        volts_table(study, circuits[name], math.inf if up_to is None else up_to * SLACK).assign(study=name)
        for name, study in studies.items()
    ]
    table = pandas.concat(tables, ignore_index=True)
    table = table if force is None else table[table.force == force]
    notes += dict.fromkeys(
        note
        for name, rows in table.groupby("study", sort=False)
        for note in resolution_notes(circuits[str(name)].step, rows.noise_V.to_numpy())
    )
    leading = ["force", *(["study"] if len(studies) > 1 else [])]
    return table[[*leading, *(name for name in table.columns if name not in ("force", "study"))]]


def _variants(studies: Mapping[str, xr.Dataset | xr.DataTree], circuits: Mapping[str, Circuit]) -> Iterator[_Variant]:
    """All variants of all studies and scenes, with readings in volts behind their circuit."""

    def readings_of(name: str, leaf: xr.Dataset) -> list[Experiment]:
        return experiments(in_volts(leaf, circuits[name]) if circuits else leaf)

    for name, study in studies.items():
        for node in [study] if isinstance(study, xr.Dataset) else study.leaves:
            scene, leaf = ("", node) if isinstance(node, xr.Dataset) else (node.name, node.to_dataset())
            labels = {**({"study": name} if len(studies) > 1 else {}), **({"scene": scene} if scene else {})}
            random_numbers = (leaf.attrs.get("seed"), leaf.attrs.get("points"), leaf.sizes["replicate"])
            watts = experiments(leaf)
            changed = {
                mode: [readings_of(name, side) for side in pair] for mode, pair in changed_by_shape(leaf).items()
            }
            for number, reading in enumerate(readings_of(name, leaf)):
                if reading.loading_runs:
                    saturated = _saturated(watts[number], circuits[name]) if circuits else math.inf
                    by_mode = {mode: [side[number] for side in pair] for mode, pair in changed.items()}
                    yield _Variant({**labels, **reading.where}, reading, by_mode, random_numbers, saturated)


def _saturated(watts: Experiment, circuit: Circuit) -> float:
    """Least magnitude of force in N at which the output of a taxel reaches the limit of the circuit, or infinity."""
    rest = 0.0 if watts.rest is None else watts.rest.mean(axis=0)
    forces = [saturation_force(circuit, run.force, run.value + rest) for run in watts.runs if len(run.force)]
    return float(np.nanmin(np.abs(forces), initial=math.inf))


def _unsaturated(variants: list[_Variant], up_to: float | None, notes: list[str]) -> list[_Variant]:
    """Variants that do not saturate within the range of force; others are left out, with a note."""
    largest_force = math.inf if up_to is None else up_to * SLACK
    saturated = [
        variant for variant in variants if variant.saturated <= largest_force and math.isfinite(variant.saturated)
    ]
    where = ["at rest" if variant.saturated == 0 else f"from {variant.saturated:.4g} N on" for variant in saturated]
    if len(saturated) == len(variants):
        named = [f"{_words(variant.where)} {at}" for variant, at in zip(saturated, where, strict=True)]
        named[MOST_NAMED:] = ["..."] if len(named) > MOST_NAMED else []
        raise InputError(
            f"no variant can be ranked: the outputs of all {len(saturated)} are saturated ({'; '.join(named)}): less "
            "amplification, or a larger full scale, is needed."
        )
    for variant, at in zip(saturated, where, strict=True):
        notes.append(f"Left out, as its output is saturated {at}: {_words(variant.where)}.")
    return [variant for variant in variants if variant not in saturated]


def _along(variants: list[_Variant], force: str | None) -> list[_Variant]:
    """Select the variants along the force ``force``; if it is None, along the only force."""
    forces = list(dict.fromkeys(variant.reading.force for variant in variants))
    if force is None and len(forces) > 1:
        raise InputError(
            f"variants along {' and '.join(forces)} cannot be compared together: choose one with force = ..."
        )
    if force is not None and force not in forces:
        raise InputError(f"force = {force!r} is not varied: one of {', '.join(forces) or 'none'} is needed.")
    return [variant for variant in variants if force in (None, variant.reading.force)]


def _in_range(variants: list[_Variant], up_to: float | None, notes: list[str]) -> list[_Variant]:
    """Variants restricted to a range of force; variants that do not reach its end are left out, with a note."""
    if up_to is None:
        return variants

    def cut(reading: Experiment) -> Experiment:
        branches = (run.part(np.abs(run.force) <= up_to * SLACK) for run in reading.runs)
        return replace(reading, runs=tuple(branch for branch in branches if len(branch.force) > 1))

    reach = [max(np.abs(run.force).max() for run in variant.reading.runs) for variant in variants]
    for variant, largest_force in zip(variants, reach, strict=True):
        if largest_force < up_to * (1 - 1e-9):
            notes.append(f"Left out, as it ends at {largest_force:g} N: {_words(variant.where)}.")
    kept = [variant for variant, largest in zip(variants, reach, strict=True) if largest >= up_to * (1 - 1e-9)]
    return [_mapped(variant, cut) for variant in kept]


def _mapped(variant: _Variant, function: Callable[[Experiment], Experiment]) -> _Variant:
    """The variant with a function applied to its readings and to its changed readings."""
    changed = {mode: list(map(function, pair)) for mode, pair in variant.changed.items()}
    return variant._replace(reading=function(variant.reading), changed=changed)


def _one_channel(variants: list[_Variant]) -> tuple[list[_Variant], str]:
    """Reduce the variants to one channel that represents all taxels. Returns the variants and the name of the channel.
    """
    readings = [variant.reading for variant in variants]
    same_size = len({len(reading.taxel) for reading in readings}) == 1
    channels = [common_channel(readings if same_size else [reading]) for reading in readings]
    reduced = [
        _mapped(variant, lambda reading, weights=weights: reading.weighted(weights))  # type: ignore[misc]
        for variant, (weights, _) in zip(variants, channels, strict=True)
    ]
    return reduced, channels[0].words if same_size else "mean of the taxels of each"


def _first_run_figures(readings: Sequence[Experiment], names: Sequence[str], column: str = "value") -> np.ndarray:
    """Figures (figures, readings) of the first run of growing force of each reading, or the errors of these figures."""
    rows = [
        {row["figure"]: row[column] for row in rows_of(reading, names) if row["loading"] == 1} for reading in readings
    ]
    for name in names:
        if any(name not in row or not np.isfinite(row[name]) for row in rows):
            raise InputError(f"{name} is unknown for some variants: {NEEDS.get(name, 'two forces')} are needed.")
    return np.array([[row[name] for row in rows] for name in names])


def _figures(
    variants: Sequence[_Variant], names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray], dict[str, str]]:
    """Figures of merit of all variants: values, errors of the light, changes by each mode of the errors of the shape,
    each (figures, variants), and units.

    The errors of derivatives, less those of the shape, count as errors of the light.
    """
    readings = [variant.reading for variant in variants]
    value, light = _first_run_figures(readings, names), _first_run_figures(readings, names, "error")
    shifts = []
    for mode in dict.fromkeys(mode for variant in variants for mode in variant.changed):
        pair = [[variant.changed.get(mode, [variant.reading] * 2)[n] for variant in variants] for n in range(2)]
        shifts.append(shape_shift(value, [_first_run_figures(changed, names) for changed in pair]))
    derived = [
        [name.endswith("slope") and reading.runs[0].tangents is not None for reading in readings] for name in names
    ]
    light = np.where(derived, besides_shape(light, shifts), light)
    table = characteristics(readings[:1])
    return value, light, shifts, dict(zip(table.figure, table.unit, strict=True))


def _covariance(
    variants: Sequence[_Variant], names: Sequence[str], light: np.ndarray, shifts: Sequence[np.ndarray]
) -> np.ndarray:
    """Covariance matrix of all figures of all variants, with (figures x variants) rows and columns. It contains the
    errors of the light and of the shape."""
    # Correlations of the light by the jackknife over replicates, of variants with the same random numbers.
    jackknife = np.array([_first_run_figures(_without_each(variant.reading), names) for variant in variants])
    spread = jackknife - jackknife.mean(axis=2, keepdims=True)  # variants, figures, replicates
    spread = spread.transpose(1, 0, 2).reshape(light.size, -1)
    size = np.linalg.norm(spread, axis=1)
    direction = spread / np.where(size > 0, size, 1)[:, None]
    numbers = [variant.numbers for variant in variants] * len(names)
    same_numbers = np.array([[first == second for second in numbers] for first in numbers])
    correlation = np.where(same_numbers, direction @ direction.T, 0.0)
    np.fill_diagonal(correlation, 1.0)
    errors = light.ravel()

    # Errors of the shape: nearly the same for variants that differ in numbers, independent between other variants.
    labels = [[value for value in variant.where.values() if isinstance(value, str)] for variant in variants]
    same_scene = np.array([[first == second for second in labels] for first in labels])
    alike = np.tile(same_scene * np.where(np.eye(len(variants)), 1.0, VARIANTS), (len(names), len(names)))
    return correlation * np.outer(errors, errors) + alike * sum(np.outer(shift, shift) for shift in shifts)


def _without_each(reading: Experiment) -> list[Experiment]:
    """Leave-one-out copies of an experiment for the jackknife, one without each replicate."""
    count = reading.runs[0].samples.shape[1]

    def without(number: int) -> Experiment:
        keep = np.delete(np.arange(count), number)
        runs = tuple(replace(run, samples=run.samples[:, keep]) for run in reading.runs)
        return replace(reading, runs=runs, rest=None if reading.rest is None else reading.rest[keep])

    return [without(number) for number in range(count)]


def _table(
    variants: Sequence[_Variant],
    names: Sequence[str],
    value: np.ndarray,
    covariance: np.ndarray,
    meets_limits: np.ndarray,
    first: np.ndarray,
    order: np.ndarray,
) -> pandas.DataFrame:
    """The table of a :class:`Comparison`, its rows in the order of the ranks."""
    import pandas

    count = len(variants)
    error = np.sqrt(np.diag(covariance)).reshape(value.shape)
    sign, best = np.sign(value[0]) if names[0] not in DEVIATIONS else -np.ones(count), order[0]
    rows = []
    for rank, number in enumerate(order.tolist(), start=1):
        # The difference from the best variant is a weighted sum of the figures.
        weights = np.zeros(covariance.shape[0])
        weights[best] += sign[best]
        weights[number] -= sign[number]
        figures = {
            key: cell
            for row, name in enumerate(names)
            for key, cell in ((name, value[row, number]), (f"{name}_error", error[row, number]))
        }
        rows.append(
            {
                "rank": rank,
                **variants[number].where,
                **figures,
                "allowed": meets_limits[number],
                "first": first[number],
                "behind": float(weights[:count] @ value[0]),
                "behind_error": float(np.sqrt(max(weights @ covariance @ weights, 0.0))),
            }
        )
    return pandas.DataFrame(rows)


def _words(where: Mapping[str, Any]) -> str:
    """Text with the parameters of a variant, such as ``wall = 1, cell = conical``."""
    return ", ".join(f"{name} = {value}" for name, value in where.items())
