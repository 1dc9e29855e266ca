"""Results of a tolerance study: spread of each figure of merit, its linear estimate, and sensitivity indices."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import changed_by_shape, with_shape
from mitsuba_taxel.electronics.noise import resolution_notes, total_noise
from mitsuba_taxel.electronics.response import lit
from mitsuba_taxel.studies.plan.vary import STEP
from mitsuba_taxel.tolerances.control import LITTLE, corrected, spreads
from mitsuba_taxel.tolerances.figures import figure_rates, figures, loaded_taxel, shown_readings
from mitsuba_taxel.tolerances.plan import FEWEST, TolerancePlan
from mitsuba_taxel.tolerances.shares import ENOUGH, SobolIndices, fewest_of, fitted, indices, more_samples

if TYPE_CHECKING:
    import pandas

NOISY = "samples are read with random numbers, whose noise is part of the spread: it may be the unexplained share"


@dataclass(frozen=True, eq=False)
class Tolerance:
    """Result of a tolerance study.

    A sample is a sensor with random values of the parameters. An exact sample is computed by mechanics and light; the
    other samples get a linear estimate from the derivatives at the mean of all parameters. A factor scales several
    parameters. A polynomial in the parameters is fitted to the samples, and Sobol' indices are computed from it.

    Figures of merit are ``rest``, the reading without a load; ``sensitivity``, its slope over the force; with a circuit
    ``noise_force``, the force that changes the reading by its noise, and ``saturation_force``, at which the circuit
    saturates; and ``crosstalk``, the relative change of a reading divided by that of
    the loaded taxel.

    Attributes
    ----------
    spread : DataFrame
        One row per figure of merit and taxel. Columns: ``unit``; ``nominal``, the value with all parameters at their
        mean, and ``nominal_error``, its standard error due to light, mechanics and geometry, NaN if unknown; ``mean``,
        ``sd`` (standard deviation), ``low`` and ``high`` (5 and 95 % quantile) of the samples, each with its standard
        error, such as ``mean_error``; ``linear_sd``, the standard deviation from derivatives; ``linear_error``, the
        root mean square error of the linear estimates of the samples, relative to ``sd``, NaN if ``sd`` is 0;
        ``explained``, the cross-validated fraction of the variance that the polynomial predicts.

        If only some samples are exact: ``mean``, ``sd``, ``low`` and ``high`` are those of the linear estimates of all
        samples, corrected by the exact samples; ``linear_error`` and ``explained`` are those of the exact samples; and
        ``linear_explained`` is the fraction of the variance of the exact samples that their linear estimates explain.
    shares : DataFrame
        One row per figure, taxel and parameter or factor: ``rate``, the derivative of the figure in ``unit``;
        ``linear``, the fraction of the variance by linear propagation; the ``first`` and ``total`` Sobol' indices with
        their errors, NaN if the polynomial explains too little of the variance.
    parameters : DataFrame
        One row per parameter or factor: its distribution (``law``), ``mean`` and ``sd``; and for each figure its
        ``total`` index, averaged over the taxels with their variances as weights, and the error of this average,
        ``total_error``.
    samples : DataFrame
        One row per sample: its parameters and factors, and the figures of all taxels. If only some samples are exact:
        ``exact`` marks these, figures of the other samples are NaN, and columns such as ``linear_rest_1`` are the
        linear estimates.
    notes : list[str]
        Notes for the reader.
    """

    spread: pandas.DataFrame
    shares: pandas.DataFrame
    parameters: pandas.DataFrame
    samples: pandas.DataFrame
    notes: list[str]


def analysed(plan: TolerancePlan, mean: xr.Dataset, samples: xr.Dataset, notes: list[str]) -> Tolerance:
    """Compute spreads, Sobol' indices and their errors from the samples of a tolerance study.

    Parameters
    ----------
    plan : TolerancePlan
        The study.
    mean : xr.Dataset
        Readings of the sensor with all parameters at their mean.
    samples : xr.Dataset
        Readings of the exact samples.
    notes : list[str]
        Notes of the run, to which the result adds further notes.

    Raises
    ------
    ComputationError
        if too few samples could be read.
    """
    import pandas

    # Readings (samples, forces, taxels); samples without readings are left out.
    force = np.array([0.0]) if not plan.force else mean[plan.force].values
    nominal = _readings(plan, mean, "smooth_power" if is_smooth(mean) else "replicate_power")[0]
    exact = _readings(plan, samples, "replicate_power")
    if bool((samples.standard_error > 0).any()):
        notes = [*notes, NOISY]
    readable = np.isfinite(exact).all(axis=(1, 2))
    unreadable = int((~readable).sum())
    if unreadable:
        notes = [
            *notes,
            f"samples without readings, left out: {unreadable} of {len(readable)} (their reasons are in samples/)",
        ]
    if readable.sum() < FEWEST:
        raise ComputationError(
            f"only {readable.sum()} of {len(readable)} samples have readings: {FEWEST} are needed (the reasons are in "
            "samples/)."
        )

    # Figures of the mean sensor and of the samples, and their derivatives by the laws.
    circuit = plan.batch.circuit
    loaded = loaded_taxel(shown_readings(nominal, circuit), force) if nominal.shape[1] > 1 else None
    at_mean, of_samples = (figures(readings, force, loaded, circuit) for readings in (nominal, exact[readable]))
    slopes = figure_rates(nominal, _rates(plan, mean, nominal), force, loaded, circuit)
    z, z_linear = plan.standardised[: plan.exact][readable], plan.standardised[plan.exact :]
    notes = [*notes, *mean.attrs["notes"].splitlines()]
    if circuit is not None:
        notes.append(f"one count: {circuit.step:.4g} V")
        notes += _note_of_saturation(of_samples, force)
        notes += resolution_notes(circuit.step, total_noise(circuit, lit(nominal)))

    # Tables of spreads and shares, and notes on them.
    tables = [_of_figure(plan, name, at_mean[name], of_samples[name], slopes[name], z, z_linear) for name in of_samples]
    spread = pandas.DataFrame([row for rows, _ in tables for row in rows])
    errors = nominal_errors(plan, mean, force, loaded)
    of_rows = [float(errors[name][taxel - 1]) for name, taxel in zip(spread.figure, spread.taxel, strict=True)]
    spread.insert(int(spread.columns.get_indexer(["nominal"])[0]) + 1, "nominal_error", of_rows)
    shares = pandas.DataFrame([row for _, rows in tables for row in rows])
    notes += _notes_of_indices(spread, shares, len(z), len(z_linear), len(plan.laws))
    spread.insert(2, "unit", spread.figure.map(_units(plan)))
    of_parameters = json.loads(mean.attrs["units"])
    shares["unit"] = [
        f"{_units(plan)[row.figure]} per {of_parameters.get(row.parameter, '1')}" for row in shares.itertuples()
    ]

    # Table of samples; those that are not exact have a linear estimate only.
    if not len(z_linear):
        table = _samples(plan, of_samples, z)
    else:
        notes += _notes_of_few(spread, shares, len(z), len(z_linear), len(plan.laws))
        every = np.concatenate([z, z_linear])
        linear = {f"linear_{name}": _linear(plan, at_mean[name], slopes[name], every) for name in of_samples}
        table = _samples(plan, {**of_samples, **linear}, every)
        varied = {law.name for law in plan.laws} | set(plan.factors.products)
        table.insert(len(varied), "exact", np.arange(len(every)) < len(z))
    notes += [*plan.factors.notes(), LEFT_OUT["tolerance"]]
    return Tolerance(spread, shares, _parameters(plan, spread, shares), table, notes)


def is_smooth(mean: xr.Dataset) -> bool:
    """Whether all readings of the sensor with the mean of all parameters are computed without random numbers, so that
    derivatives exist.
    """
    return "smooth_power" in mean and bool(np.isfinite(mean.smooth_power).all())


def _samples(plan: TolerancePlan, values_of: dict[str, np.ndarray], z: np.ndarray) -> pandas.DataFrame:
    """The table of samples, one row each: parameters, factors, and figures.

    ``values_of`` holds each figure as (samples, taxels), which may lack the last samples; ``z`` (samples, laws) are the
    standardised values of the laws.
    """
    import pandas

    laws = {law.name: law.mean + z[:, number] * law.deviation for number, law in enumerate(plan.laws)}
    columns = {**laws, **plan.factors.parameters(laws)}
    for name, values in values_of.items():
        padded = np.full((len(z), values.shape[1]), math.nan)
        padded[: len(values)] = values
        columns |= {f"{name}_{taxel}": column for taxel, column in enumerate(padded.T, start=1)}
    return pandas.DataFrame(columns)


def _notes_of_indices(
    spread: pandas.DataFrame, shares: pandas.DataFrame, exact: int, linear: int, parameters: int
) -> list[str]:
    """A note for each figure without Sobol' indices, with a remedy; the last arguments as in :func:`_notes_of_few`."""
    notes = []
    for name, rows in spread.groupby("figure", sort=False):
        unknown = shares[(shares.figure == name) & shares.total.isna()].taxel.unique()
        if len(unknown) and (rows.sd > 0).any():
            worst = rows.explained.min()
            why = f"the polynomial explains {max(worst, 0):.0%} of the variance" if worst == worst else "few are exact"
            more = more_samples(parameters, exact)
            help_ = "a smaller spread"
            if more is not None:
                # A Sobol' sequence needs a power of 2.
                settings = [f"samples = {1 << (more[0] - 1).bit_length()}"] if more[0] > exact + linear else []
                settings += [f"exact = {more[0]}"] if linear else []
                help_ = f"{' and '.join(settings)} or more, to which a polynomial of degree {more[1]} is fitted,"
            notes.append(
                f"Sobol' indices of {name} are unknown for {len(unknown)} of {len(rows)} taxels: {why}, {ENOUGH:.0%} "
                f"are needed; {help_} may explain more"
            )
    return notes


def _notes_of_few(
    spread: pandas.DataFrame, shares: pandas.DataFrame, exact: int, linear: int, parameters: int
) -> list[str]:
    """Notes on results of few exact samples; the last three arguments are numbers of samples and of laws."""
    without = [name for name, rates in shares.groupby("parameter", sort=False).rate if rates.isna().all()]
    if len(without) == parameters:
        return [
            f"no parameter has a linear estimate: results come from the {exact} exact samples alone; the other "
            f"{linear} samples add nothing; a larger exact reduces the errors"
        ]
    but = f", which leaves out {', '.join(without)}," if without else ""
    notes = []
    for name, rows in spread.groupby("figure", sort=False):
        little = rows[rows.linear_explained < LITTLE]
        if len(little):
            worst = little.loc[little.linear_explained.idxmin()]
            notes.append(
                f"the linear estimate{but} explains only {worst.linear_explained:.0%} of the variance of {name} (taxel "
                f"{worst.taxel}) over the {exact} exact samples: the other {linear} samples add little; a larger exact "
                "reduces the errors"
            )
    if fewest_of(parameters) > exact:
        notes.append(
            f"Sobol' indices are shares of the linear estimate: for a polynomial of {parameters} parameters "
            f"exact = {fewest_of(parameters)} or more is needed"
        )
    return notes


def nominal_errors(
    plan: TolerancePlan, mean: xr.Dataset, force: np.ndarray, loaded: int | None
) -> dict[str, np.ndarray]:
    """Standard errors of the figures of merit at the mean of all parameters, due to the light and the pad's shape.

    Errors of the light follow from its replicates. Errors of the shape are modelled as smooth random functions of the
    force, common to all taxels; see `characterise.shape_error`. In the cross-talk, a ratio of two taxels, an error that
    changes both taxels by the same fraction cancels. Errors of irregular meshes do not cancel; the changes due to the
    loaded taxel and due to the other taxels are therefore added in quadrature.

    Parameters
    ----------
    plan : TolerancePlan
        The study.
    mean : xr.Dataset
        Readings of the mean sensor.
    force : np.ndarray
        Forces (forces,) in N.
    loaded : int or None
        Index of the loaded taxel, for the cross-talk.

    Returns
    -------
    dict[str, (T,) ndarray]
        Errors by figure for T taxels, one standard deviation in the unit of the figure.
    """

    def figures_of(study: xr.Dataset) -> dict[str, np.ndarray]:
        return figures(_readings(plan, study, "replicate_power")[0], force, loaded, plan.batch.circuit)

    mean = with_forces_named(mean)  # as `changed_by_shape` has them
    value, changed_studies = figures_of(mean), changed_by_shape(mean)
    replicates = [figures_of(mean.isel(replicate=[number])) for number in range(mean.sizes["replicate"])]
    changed_figures = {mode: [figures_of(study) for study in both] for mode, both in changed_studies.items()}
    errors = {}
    for name, at_mean in value.items():
        changed = {mode: [values[name] for values in both] for mode, both in changed_figures.items()}
        if name == "crosstalk":
            of_loaded = mean.taxel == mean.taxel[loaded]
            for mode, both in changed_studies.items():
                for words, which in (("loaded", of_loaded), ("others", ~of_loaded)):
                    changed_power = (study.replicate_power.where(which, mean.replicate_power) for study in both)
                    entry = (*mode, words)
                    changed[entry] = [
                        figures_of(mean.assign(replicate_power=power))[name] for power in changed_power
                    ]
        with np.errstate(invalid="ignore"):  # infinite figures have no error
            light = standard_error(np.array([values[name] for values in replicates]))
            errors[name] = with_shape(light, at_mean, changed)
    return errors


def _note_of_saturation(figures_of: dict[str, np.ndarray], force: np.ndarray) -> list[str]:
    """A note on the number of samples whose output saturates; none without a circuit."""
    if "saturation_force" not in figures_of:
        return []
    saturated = np.isfinite(figures_of["saturation_force"])
    count, samples, most = saturated.sum(axis=0), len(saturated), int(saturated.sum(axis=0).argmax())
    words = f"{count[most]} of {samples} samples (taxel {most + 1})" if count.any() else f"none of {samples} samples"
    least, largest = force[np.abs(force).argmin()], force[np.abs(force).argmax()]
    return [f"the output reaches the circuit's limit between {least:g} and {largest:g} N in {words}"]


def _readings(plan: TolerancePlan, study: xr.Dataset, name: str) -> np.ndarray:
    """A variable of a study as (samples, forces, taxels) in W, the mean of replicates."""
    readings = study[name]
    if "replicate" in readings.dims:
        readings = readings.mean("replicate")
    if not plan.force:
        readings = readings.expand_dims("force")
    # The force component, under any parameter name.
    (along,) = (dim for dim in readings.dims if dim not in (STEP, "taxel"))
    return readings.transpose(STEP, along, "taxel").values


def _rates(plan: TolerancePlan, mean: xr.Dataset, nominal: np.ndarray) -> np.ndarray:
    """Derivatives of readings with respect to the laws, (forces, taxels, laws) in W per unit of the law.

    They are NaN for a law if a parameter that depends on it has no derivative.
    """
    rates = np.full((*nominal.shape, len(plan.laws)), math.nan)
    if "derivative" in mean:
        derivative = mean.derivative.isel({STEP: 0})
        if not plan.force:
            derivative = derivative.expand_dims("force")
        derivatives = derivative.transpose("parameter", plan.force or "force", "taxel")
        for number, law in enumerate(plan.laws):
            chain = plan.factors.partial_derivatives(law.name)
            if set(chain) <= set(derivative.parameter.values):
                rates[..., number] = sum(derivatives.sel(parameter=name).values * by for name, by in chain.items())
    return rates


def _of_figure(
    plan: TolerancePlan,
    name: str,
    at_mean: np.ndarray,
    exact: np.ndarray,
    slopes: np.ndarray,
    z: np.ndarray,
    z_linear: np.ndarray,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Table rows of one figure of merit: of its spreads, and of the shares of the parameters.

    Parameters
    ----------
    plan : TolerancePlan
        The study.
    name : str
        The figure.
    at_mean : (T,) ndarray
        Values of the figure for the mean sensor.
    exact : (N, T) ndarray
        Values of the figure for the exact samples.
    slopes : (T, laws) ndarray
        Derivatives of the figure with respect to the laws.
    z, z_linear : (N, laws) and (M, laws) ndarray
        Standardised values of the exact samples, and of those with a linear estimate only.
    """
    # The linear estimate, and its error over the exact samples.
    per_deviation = slopes * [law.deviation for law in plan.laws]
    deviation, error = deviations(exact)
    linear = np.sqrt(np.square(per_deviation).sum(axis=1))
    missed = exact - at_mean - z @ per_deviation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        linear_error = np.where(deviation > 0, np.sqrt(np.square(missed).mean(axis=0)) / deviation, math.nan)
        linear_share = np.square(per_deviation / linear[:, None])

    # Taxels with a value in all samples: moments, by the control variate if some samples are linear only.
    complete = np.isfinite(exact).all(axis=0)
    polynomial = fitted(z, np.where(complete, exact, 0.0))
    of_samples = np.where(complete, exact, 0.0)
    few = spreads(of_samples, plan.batch.seed)
    if len(z_linear):
        few = _corrected(plan, at_mean, of_samples, slopes, z, z_linear)

    # Sobol' indices: of a polynomial, or of the linear estimate as far as it explains the samples.
    sobol = SobolIndices(*np.full((4, *slopes.shape), math.nan))
    if polynomial is not None:
        sobol = indices(polynomial, plan.laws)
    elif len(z_linear):
        missed = 1 - few["linear_explained"][:, None]
        linear_share = np.where(missed <= 1 - ENOUGH, linear_share, math.nan)
        sobol = SobolIndices(linear_share, linear_share, *2 * [linear_share * 0 + np.maximum(missed, 0.0) / 2])

    # Rows of both tables.
    spread, shares = [], []
    for taxel in np.flatnonzero(complete):
        where = {"figure": name, "taxel": int(taxel) + 1}
        low, high = np.quantile(exact[:, taxel], (0.05, 0.95))
        numbers = {
            "nominal": at_mean[taxel], "mean": exact[:, taxel].mean(), "sd": deviation[taxel],
            "sd_error": error[taxel], "low": low, "high": high, "linear_sd": linear[taxel],
            "linear_error": linear_error[taxel],
            "explained": math.nan if polynomial is None else polynomial.explained[taxel],
        }  # fmt: skip
        numbers |= {key: values[taxel] for key, values in few.items()}
        spread.append(where | {key: float(value) for key, value in numbers.items()})
        for number, law in enumerate(plan.laws):
            arrays = (slopes, linear_share, *sobol)
            values = (float(array[taxel, number]) for array in arrays)
            named = zip(("rate", "linear", *SobolIndices._fields), values, strict=True)
            shares.append({**where, "parameter": law.name, **dict(named)})
    return spread, shares


def _corrected(
    plan: TolerancePlan, at_mean: np.ndarray, exact: np.ndarray, slopes: np.ndarray, z: np.ndarray, z_linear: np.ndarray
) -> dict[str, np.ndarray]:
    """The moments of :func:`corrected`, with the linear estimates of both kinds of samples; NaN counts as 0."""
    linear, of_others = (np.nan_to_num(_linear(plan, at_mean, slopes, standardised)) for standardised in (z, z_linear))
    return corrected(exact, linear, of_others, plan.batch.seed)


def _linear(plan: TolerancePlan, at_mean: np.ndarray, slopes: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Linear estimate (samples, T) of the figure at standardised values (samples, laws), from laws with a
    derivative."""
    rates = np.where(np.isfinite(slopes), slopes, 0.0)
    return at_mean + z @ (rates * [law.deviation for law in plan.laws]).T


def deviations(exact: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations of samples, with their standard errors, which follow from the kurtosis (the weight of the
    tails).

    The errors are valid for random samples, and conservative for Latin hypercubes and Sobol' points. Few samples
    underestimate the kurtosis. The estimate used here is unbiased for normal samples, is at least the kurtosis of a
    normal distribution, and is increased by its uncertainty.

    Parameters
    ----------
    exact : (N, T) ndarray
        N samples of T taxels.

    Returns
    -------
    deviation, error : (T,) ndarray
        Standard deviations and their standard errors, in the unit of the samples.
    """
    from scipy.stats import kurtosis

    count = len(exact)
    deviation = exact.std(axis=0, ddof=1)
    varies = deviation > 0
    excess = np.zeros_like(deviation)
    if varies.any() and count > 3:
        excess[varies] = np.maximum(kurtosis(exact[:, varies], bias=False), 0.0)
    excess += math.sqrt(24 / count)
    return deviation, deviation * np.sqrt((2 * count / (count - 1) + excess) / (4 * count))


def _units(plan: TolerancePlan) -> dict[str, str]:
    """Unit of each figure of merit, by its name."""
    unit = "W" if plan.batch.circuit is None else "V"
    return {
        "rest": unit, "sensitivity": f"{unit}/N", "noise_force": "N", "saturation_force": "N", "crosstalk": "1",
    }  # fmt: skip


def _parameters(plan: TolerancePlan, spread: pandas.DataFrame, shares: pandas.DataFrame) -> pandas.DataFrame:
    """Create the table ``parameters`` of `Tolerance`: one row for each parameter or factor."""
    import pandas

    table = shares.merge(spread[["figure", "taxel", "sd"]], on=["figure", "taxel"])
    table["weight"] = table.sd**2 * table.total.notna()

    def weighted(rows: pandas.DataFrame, column: str) -> float:
        is_known = rows.weight.sum() > 0
        return float(np.average(rows[column].fillna(0.0), weights=rows.weight)) if is_known else math.nan

    groups = table.groupby(["figure", "parameter"])
    indices_of = {(*key, column): weighted(rows, column) for key, rows in groups for column in ("total", "total_error")}
    names = list(dict.fromkeys(spread.figure))
    return pandas.DataFrame(
        {
            "parameter": law.name,
            "law": law.words,
            "mean": law.mean,
            "sd": law.deviation,
            **{
                f"{column}_{name}": indices_of[name, law.name, column]
                for name in names
                for column in ("total", "total_error")
            },
        }
        for law in plan.laws
    )
