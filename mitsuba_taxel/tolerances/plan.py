"""Plan of a tolerance study: the sensor with all parameters at their mean, and samples of their distributions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import check_whole, is_whole
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of
from mitsuba_taxel.studies.plan.batch import Batch, batch_from, parameters_in, read_study_of
from mitsuba_taxel.studies.plan.vary import STEP
from mitsuba_taxel.tolerances.factors import Factors, read_factors
from mitsuba_taxel.tolerances.laws import Law

KEYS = ("exact", "of", "samples", "sampling")
SAMPLES = 64
SAMPLINGS = ("latin_hypercube", "sobol")
FEWEST, MOST = 8, 20_000
BEYOND = 1e-6
"""Probability that a distribution may exceed the range of a parameter, on each side."""


@dataclass(frozen=True, eq=False)
class TolerancePlan:
    """Definition of a tolerance study.

    Attributes
    ----------
    factors : Factors
        Distributions of the independent variables, and the parameters of the scene as products of them.
    force : str
        Name of the varied force; empty if none is varied.
    shares : (samples, laws) ndarray
        Samples of the independent variables, as cumulative probabilities of their distributions.
    exact : int
        Number of exact samples, computed by mechanics and light; these are the first samples.
    batch : Batch
        The sensor with all parameters at their mean.
    """

    factors: Factors
    force: str
    shares: np.ndarray
    exact: int
    batch: Batch

    @property
    def laws(self) -> list[Law]:
        """The distributions of the independent variables."""
        return self.factors.laws

    @property
    def standardised(self) -> np.ndarray:
        """Samples (samples, laws) of the independent variables, as differences from the mean in standard deviations,
        rounded as in written scenes.
        """
        values = np.array(list(self._columns().values())).T
        return (values - [law.mean for law in self.laws]) / [law.deviation for law in self.laws]

    def samples(self, points: int, mesh_size: float | None) -> Batch:
        """The batch of the exact samples, with the points and the mesh size of the mean sensor."""
        rows = {name: words[: self.exact] for name, words in self._words().items()}
        axes = tuple(axis._replace(values=rows) if axis.dim == STEP else axis for axis in self.batch.axes)
        batch = replace(self.batch, name="samples", axes=axes, bare=True)
        return replace(batch, points=points, mesh_size=mesh_size, target_error=None, time_budget=None)

    def _words(self) -> dict[str, list[str]]:
        values = self.factors.parameters(self._columns())
        return {name: [f"{value:.12g}" for value in column] for name, column in values.items()}

    def _columns(self) -> dict[str, np.ndarray]:
        """Values (samples,) of each independent variable, rounded as in written scenes."""
        columns = (law.values(column) for law, column in zip(self.laws, self.shares.T, strict=True))
        rounded = [np.array([float(f"{value:.12g}") for value in column]) for column in columns]
        return {law.name: column for law, column in zip(self.laws, rounded, strict=True)}


def read_plan(file: Path, exact: int | None = None) -> TolerancePlan:
    """Read the definition of a tolerance study from a study file with a table ``[tolerance]``.

    Parameters
    ----------
    file : Path
        Study file.
    exact : int, optional
        Number of exact samples, whose pads are solved; the others are read from a linear model. It replaces ``exact``
        of the table.

    Raises
    ------
    InputError
        if the file has no such table, or a distribution exceeds the range of its parameter.
    """
    content, table = read_study_of("tolerance", file)
    (scene,) = content["scenes"]
    if not isinstance(table, dict) or not isinstance(table.get("of"), dict) or not table["of"]:
        raise InputError(f"study {file.name} has no tolerances: a table [tolerance.of] of distributions is needed.")
    for name in table:
        if name not in KEYS:
            raise InputError(f"tolerance: {name} is not known: allowed are {', '.join(KEYS)}.")
    for name in ("together", "steps", "derivatives", "target_slope"):
        if name in scene or name in content:
            raise InputError(f"{name} is not allowed in a tolerance study: take it out.")

    # The laws, and the batch of the sensor with all parameters at their mean.
    folder = file.resolve().parent
    defines = scene.get("define", {})
    factors = read_factors(table["of"], {**parameters_in(str(scene.get("scene")), folder), **defines})
    # Parameters that are scaled vary, and must not have a fixed value too.
    scene["define"] = {name: value for name, value in defines.items() if name not in factors.constants}
    at_mean = factors.parameters({law.name: law.mean for law in factors.laws})
    scene["together"] = {name: [f"{value:.12g}"] for name, value in at_mean.items()}
    batch = batch_from(content, 0, folder)

    # The samples, and the ranges that all laws must keep.
    shares = _shares(table.get("samples", SAMPLES), table.get("sampling", SAMPLINGS[0]), len(factors.laws), batch.seed)
    count = _exact(table.get("exact", len(shares)) if exact is None else exact, len(shares))
    plan = TolerancePlan(factors, _force(batch), shares, count, replace(batch, name="nominal"))
    for law in factors.laws:
        _check_range(plan, law)
    return plan


def _shares(samples: Any, sampling: Any, parameters: int, seed: int) -> np.ndarray:
    """Cumulative probabilities (samples, parameters) by a Latin hypercube or a scrambled Sobol' sequence."""
    from scipy.stats import qmc

    check_whole("samples", samples, FEWEST, MOST)
    if sampling not in SAMPLINGS:
        raise InputError(f"sampling = {sampling!r} is not allowed: one of {', '.join(SAMPLINGS)} is needed.")
    if sampling == "sobol" and samples & (samples - 1):
        raise InputError(f"samples = {samples} is not allowed with sampling sobol: a power of 2 is needed.")
    engine = {"latin_hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol}[sampling]
    return engine(parameters, seed=np.random.default_rng(seed)).random(samples)


def _exact(exact: Any, samples: int) -> int:
    """Check the number of exact samples, and return it. The first samples of the study are the exact ones.

    They represent all samples: rows of a Latin hypercube are in random order, and the beginning of a scrambled Sobol'
    sequence is such a sequence itself.
    """
    if not (is_whole(exact) and FEWEST <= exact <= samples):
        raise InputError(
            f"exact = {exact!r} is not allowed: a whole number from {FEWEST} to {samples}, the number of samples, is "
            "needed."
        )
    return exact


def _force(batch: Batch) -> str:
    """Name of the varied force, empty if none; raises `InputError` if anything else varies, or the force has one
    value."""
    axes = [axis for axis in batch.axes if axis.dim != STEP]
    if not axes:
        return ""
    (first, *further_axes) = axes
    if further_axes or not first.is_force or first.size < 2 or first.is_open:
        raise InputError(
            f"vary = {', '.join(axis.dim for axis in axes)} is not allowed in a tolerance study: one component of "
            f"the force, with two values or more, or no vary is needed."
        )
    return first.dim


def _check_range(plan: TolerancePlan, law: Law) -> None:
    """Raise `InputError` if a distribution exceeds the range of its parameter, with all others at their mean."""
    mean = {other_law.name: other_law.mean for other_law in plan.laws}
    for end in (BEYOND, 1 - BEYOND):
        value = float(law.values(np.array(end)))
        parameters = plan.factors.parameters({**mean, law.name: value})
        reason = refusal_of(plan.batch.scene({name: f"{number:.12g}" for name, number in parameters.items()}))
        if reason:
            raise InputError(
                f"tolerance of {law.name}: {law.words} has values that are not allowed, such as {value:.4g}: {reason}"
            )
