"""Ranking of variants of a sensor by a figure of merit, with probabilities."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.characteristics import DEVIATIONS, SLOPES, characteristics
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.shape_error import VARIANTS, Mode, besides_shape, off_by_shape, shape_shift
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
"""Factor of forces that are equal to a limit but for rounding."""
WITHIN = 0.5
"""Least probability to meet the limits of a variant that counts as within them."""
DRAWS = 20_000
"""Random draws for the probabilities: accurate to 0.4 percentage points."""


class Comparison(NamedTuple):
    """Variants by rank.

    Where no variant is more likely within the limits than not, none has a rank, and ``behind`` is NaN.

    Attributes
    ----------
    table : pandas.DataFrame
        A row for each variant: ``rank``; the parameters in which the variants differ; a column for each figure and its
        ``_error``; ``allowed``, the probability that the variant meets the limits; ``first``, that it is the best of
        those that do; ``behind``, the difference from the first one, and ``behind_error``.
    by : str
        The figure of the ranking.
    limits : dict[str, float]
        Largest magnitudes of figures, in their units.
    unit : dict[str, str]
        Unit of each figure.
    channel : str
        The channel that represents the taxels.
    volts : pandas.DataFrame or None
        The ``volts_table`` of all studies; None without a circuit.
    notes : list[str]
        What a reader of the table should know.
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
        """Whether any variant is within the limits."""
        return bool(self.table["rank"].notna().all())


class _Variant(NamedTuple):
    where: dict[str, Any]
    reading: Experiment
    off: dict[Mode, list[Experiment]]
    numbers: tuple[Any, ...]  # the random numbers: seed and points
    saturated: float = math.inf  # least magnitude of force in N at which a taxel saturates


def compare(
    studies: Mapping[str, xr.Dataset | xr.DataTree],
    by: str = "relative_slope",
    at_most: Mapping[str, float] | None = None,
    *,
    force: str | None = None,
    up_to: float | None = None,
    circuit: Circuit | None = None,
) -> Comparison:
    """Rank the variants of a sensor in studies: one for each combination of the parameters varied besides the force.

    Arrays are represented by one channel. Slopes are ranked by magnitude, the largest first; deviations the smallest
    first. Errors are those of ``taxel characterise``. Variants of the same seed and points share their random numbers,
    whose common effect cancels in differences, as estimated by the jackknife over replicates. Errors of mechanics and
    geometry have a correlation of 0.88 between variants that differ in numerical parameters only; those of other shapes
    or scenes are independent.

    Readings are in volts if there is a circuit, else in watts. A variant that saturates within the range of forces is
    not ranked, as its figures are those of its circuit.

    Parameters
    ----------
    studies : Mapping[str, xr.Dataset or xr.DataTree]
        Studies by a unique name.
    by : str
        One of max_slope, mean_slope, zero_slope, relative_slope, nonlinearity, hysteresis and repeatability.
    at_most : Mapping[str, float], optional
        Limits of some of these in their units: % for deviations, %/N and W/N, or V/N behind a circuit, for slopes.
    force : str, optional
        Force along which to compare, if the studies vary several.
    up_to : float, optional
        Largest force in N that is used; variants that do not reach it are left out.
    circuit : Circuit, optional
        Behind which all readings are compared, instead of those of the studies.

    Returns
    -------
    Comparison
        A table of the variants, the best first.

    Raises
    ------
    InputError
        if there are fewer than two variants, all saturate, or they lack a figure; or if only some of the studies have a
        circuit.
    """
    import pandas

    limits = dict(at_most or {})
    for name in (by, *limits):
        if name not in FIGURES:
            raise InputError(f"figure {name!r} is not known: one of {', '.join(FIGURES)} is needed.")
    notes: list[str] = []
    circuits = _circuits(studies, circuit)
    variants = _in_range(_along(list(_variants(studies, circuits)), force), up_to, notes)
    if len(variants) < 2:
        raise InputError(f"{len(variants)} variants along a force are not enough: at least two to compare are needed.")
    variants = _unsaturated(variants, up_to, notes)
    variants, channel = _one_channel(variants)
    names = list(dict.fromkeys([by, *limits]))
    value, light, shifts, units = _figures(variants, names)
    covariance = _covariance(variants, names, light, shifts)
    random = np.random.default_rng(0)
    drawn = random.multivariate_normal(value.ravel(), covariance, DRAWS, method="eigh").reshape(DRAWS, *value.shape)
    allowed = np.ones((DRAWS, len(variants)), dtype=bool)
    for name, limit in limits.items():
        allowed &= np.abs(drawn[:, names.index(name)]) <= limit
    score = np.where(allowed, _score(by, drawn[:, 0]), -np.inf)
    first = np.bincount(score.argmax(axis=1)[allowed.any(axis=1)], minlength=len(variants)) / DRAWS
    meets = allowed.mean(axis=0)
    within = meets >= WITHIN
    order = np.lexsort((-_score(by, value[0]), ~within if within.any() else -meets))
    table = _table(variants, names, value, covariance, meets, first, order)
    if not within.any():
        table = table.assign(
            rank=pandas.array([pandas.NA] * len(table), dtype="Int64"), behind=np.nan, behind_error=np.nan
        )
    volts = _volts(studies, circuits, force, up_to, notes) if circuits else None
    return Comparison(table, by, limits, units, channel, volts, notes)


def _score(by: str, value: np.ndarray) -> np.ndarray:
    return -value if by in DEVIATIONS else np.abs(value)


def _circuits(studies: Mapping[str, xr.Dataset | xr.DataTree], circuit: Circuit | None) -> dict[str, Circuit]:
    """The circuit behind each study; empty if there is none."""
    own = {name: circuit or circuit_of_study(study) for name, study in studies.items()}
    known = {name: each for name, each in own.items() if each is not None}
    if known and len(known) < len(own):
        without = next(name for name in own if name not in known)
        raise InputError(
            f"{next(iter(known))} in volts and {without} in watts cannot be compared: a circuit for all is needed."
        )
    return known


def _volts(
    studies: Mapping[str, xr.Dataset | xr.DataTree],
    circuits: Mapping[str, Circuit],
    force: str | None,
    up_to: float | None,
    notes: list[str],
) -> pandas.DataFrame:
    """What the circuits show along the lines that are compared; that steps of a converter hide the noise is noted."""
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
    first = ["force", *(["study"] if len(studies) > 1 else [])]
    return table[[*first, *(name for name in table.columns if name not in ("force", "study"))]]


def _variants(studies: Mapping[str, xr.Dataset | xr.DataTree], circuits: Mapping[str, Circuit]) -> Iterator[_Variant]:
    for name, study in studies.items():
        for each in [study] if isinstance(study, xr.Dataset) else study.leaves:
            scene, leaf = ("", each) if isinstance(each, xr.Dataset) else (each.name, each.to_dataset())
            labels = {**({"study": name} if len(studies) > 1 else {}), **({"scene": scene} if scene else {})}
            numbers = (leaf.attrs.get("seed"), leaf.attrs.get("points"), leaf.sizes["replicate"])
            watts = experiments(leaf)
            found = experiments(in_volts(leaf, circuits[name])) if circuits else watts
            off = {
                mode: [experiments(in_volts(each, circuits[name]) if circuits else each) for each in both]
                for mode, both in off_by_shape(leaf).items()
            }
            for number, one in enumerate(found):
                if one.loading_runs:
                    saturated = _saturated(watts[number], circuits[name]) if circuits else math.inf
                    changed = {mode: [all_[number] for all_ in both] for mode, both in off.items()}
                    yield _Variant({**labels, **one.where}, one, changed, numbers, saturated)


def _saturated(watts: Experiment, circuit: Circuit) -> float:
    """Least magnitude of force at which a taxel brings the output to the circuit's limit; infinite if none does."""
    rest = 0.0 if watts.rest is None else watts.rest.mean(axis=0)
    forces = [saturation_force(circuit, run.force, run.value + rest) for run in watts.runs if len(run.force)]
    return float(np.nanmin(np.abs(forces), initial=math.inf))


def _unsaturated(variants: list[_Variant], up_to: float | None, notes: list[str]) -> list[_Variant]:
    """Variants that do not saturate within the range of force; the others are noted and left out."""
    most = math.inf if up_to is None else up_to * SLACK
    blind = [one for one in variants if one.saturated <= most and math.isfinite(one.saturated)]
    for one in blind:
        where = "at rest" if one.saturated == 0 else f"from {one.saturated:.4g} N on"
        notes.append(f"Left out, as its output is saturated {where}: {_words(one.where)}.")
    if len(blind) == len(variants):
        raise InputError(f"no variant can be ranked: all {len(blind)} saturate. {notes[-1]}")
    return [one for one in variants if one not in blind]


def _along(variants: list[_Variant], force: str | None) -> list[_Variant]:
    """The variants along one force."""
    forces = list(dict.fromkeys(variant.reading.force for variant in variants))
    if force is None and len(forces) > 1:
        raise InputError(f"variants along {' and '.join(forces)} cannot be compared: one force has to be named.")
    if force is not None and force not in forces:
        raise InputError(f"force = {force!r} is not varied: one of {', '.join(forces) or 'none'} is needed.")
    return [variant for variant in variants if force in (None, variant.reading.force)]


def _in_range(variants: list[_Variant], up_to: float | None, notes: list[str]) -> list[_Variant]:
    """Variants restricted to a range of force; those that do not reach it are noted and left out."""
    if up_to is None:
        return variants

    def cut(one: Experiment) -> Experiment:
        parts = (run.part(np.abs(run.force) <= up_to * SLACK) for run in one.runs)
        return replace(one, runs=tuple(part for part in parts if len(part.force) > 1))

    reach = [max(np.abs(run.force).max() for run in variant.reading.runs) for variant in variants]
    for variant, most in zip(variants, reach, strict=True):
        if most < up_to * (1 - 1e-9):
            notes.append(f"Left out, as it ends at {most:g} N: {_words(variant.where)}.")
    enough = [one for one, most in zip(variants, reach, strict=True) if most >= up_to * (1 - 1e-9)]
    return [_mapped(one, cut) for one in enough]


def _mapped(variant: _Variant, function: Callable[[Experiment], Experiment]) -> _Variant:
    off = {mode: list(map(function, both)) for mode, both in variant.off.items()}
    return variant._replace(reading=function(variant.reading), off=off)


def _one_channel(variants: list[_Variant]) -> tuple[list[_Variant], str]:
    readings = [variant.reading for variant in variants]
    alike = len({len(one.taxel) for one in readings}) == 1
    channels = [common_channel(readings if alike else [one]) for one in readings]
    reduced = [
        _mapped(one, lambda each, weights=weights: each.weighted(weights))  # type: ignore[misc]
        for one, (weights, _) in zip(variants, channels, strict=True)
    ]
    return reduced, channels[0].words if alike else "mean of the taxels of each"


def _found(readings: Sequence[Experiment], names: Sequence[str], column: str = "value") -> np.ndarray:
    """(figures, readings) of the first run of growing force."""
    table = characteristics([replace(one, where={"number": number}) for number, one in enumerate(readings)])
    rows: list[dict[str, float]] = [{} for _ in readings]
    for number, figure, loading, cell in zip(table.number, table.figure, table.loading, table[column], strict=True):
        if loading == 1:
            rows[number][figure] = cell
    for name in names:
        if any(name not in row or not np.isfinite(row[name]) for row in rows):
            raise InputError(f"{name} is not known of every variant: {NEEDS.get(name, 'two forces')} are needed.")
    return np.array([[row[name] for row in rows] for name in names])


def _figures(
    variants: Sequence[_Variant], names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray], dict[str, str]]:
    """Values, errors of the light, changes by each mode of the errors of the shape (figures, variants), and units.

    Errors of derivatives beside those of the shape are counted as of the light.
    """
    readings = [variant.reading for variant in variants]
    value, light = _found(readings, names), _found(readings, names, "error")
    shifts = []
    for mode in dict.fromkeys(mode for variant in variants for mode in variant.off):
        both = [[variant.off.get(mode, [variant.reading] * 2)[n] for variant in variants] for n in range(2)]
        shifts.append(shape_shift(value, [_found(changed, names) for changed in both]))
    derived = [[name.endswith("slope") and one.runs[0].tangents is not None for one in readings] for name in names]
    light = np.where(derived, besides_shape(light, shifts), light)
    table = characteristics(readings[:1])
    return value, light, shifts, dict(zip(table.figure, table.unit, strict=True))


def _covariance(
    variants: Sequence[_Variant], names: Sequence[str], light: np.ndarray, shifts: Sequence[np.ndarray]
) -> np.ndarray:
    """Covariance of all figures (figures x variants): of the light by the jackknife over replicates, and of the
    shape."""
    left_out = np.array([_found(_without_each(variant.reading), names) for variant in variants])
    spread = left_out - left_out.mean(axis=2, keepdims=True)  # variants, figures, replicates
    spread = spread.transpose(1, 0, 2).reshape(light.size, -1)
    size = np.linalg.norm(spread, axis=1)
    share = spread / np.where(size > 0, size, 1)[:, None]
    numbers = [variant.numbers for variant in variants] * len(names)
    shared = np.array([[one == other for other in numbers] for one in numbers])
    correlation = np.where(shared, share @ share.T, 0.0)
    np.fill_diagonal(correlation, 1.0)
    errors = light.ravel()
    kinds = [[value for value in variant.where.values() if isinstance(value, str)] for variant in variants]
    same = np.array([[one == other for other in kinds] for one in kinds])
    alike = np.tile(same * np.where(np.eye(len(variants)), 1.0, VARIANTS), (len(names), len(names)))
    return correlation * np.outer(errors, errors) + alike * sum(np.outer(shift, shift) for shift in shifts)


def _without_each(reading: Experiment) -> list[Experiment]:
    """The experiment without each of its replicates."""
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
    meets: np.ndarray,
    first: np.ndarray,
    order: np.ndarray,
) -> pandas.DataFrame:
    import pandas

    count = len(variants)
    error = np.sqrt(np.diag(covariance)).reshape(value.shape)
    sign, best = np.sign(value[0]) if names[0] not in DEVIATIONS else -np.ones(count), order[0]
    rows = []
    for rank, number in enumerate(order.tolist(), start=1):
        weights = np.zeros(covariance.shape[0])
        weights[best] += sign[best]
        weights[number] -= sign[number]
        figures = {
            key: cell
            for place, name in enumerate(names)
            for key, cell in ((name, value[place, number]), (f"{name}_error", error[place, number]))
        }
        rows.append(
            {
                "rank": rank,
                **variants[number].where,
                **figures,
                "allowed": meets[number],
                "first": first[number],
                "behind": float(weights[:count] @ value[0]),
                "behind_error": float(np.sqrt(max(weights @ covariance @ weights, 0.0))),
            }
        )
    return pandas.DataFrame(rows)


def _words(where: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in where.items())
