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
"""Share of a distribution that may lie beyond the range of a parameter, on each side."""


@dataclass(frozen=True, eq=False)
class TolerancePlan:
    """A tolerance study.

    Attributes
    ----------
    factors : Factors
        Distributions, and the parameters with tolerances as products of them.
    force : str
        The varied force; empty if none is.
    shares : (samples, laws) ndarray
        Cumulative probabilities of the samples.
    exact : int
        Samples computed by the whole chain: the first ones.
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
        """The distributions."""
        return self.factors.laws

    @property
    def standardised(self) -> np.ndarray:
        """(samples, laws) relative to the mean, in standard deviations, with values rounded as written."""
        values = np.array(list(self._columns().values())).T
        return (values - [law.mean for law in self.laws]) / [law.deviation for law in self.laws]

    def samples(self, points: int, mesh_size: float | None) -> Batch:
        """The batch of the samples to be computed, with the points and the mesh of the mean sensor."""
        rows = {name: words[: self.exact] for name, words in self._words().items()}
        axes = tuple(axis._replace(values=rows) if axis.dim == STEP else axis for axis in self.batch.axes)
        batch = replace(self.batch, name="samples", axes=axes, bare=True)
        return replace(batch, points=points, mesh_size=mesh_size, target_error=None, time_budget=None)

    def _words(self) -> dict[str, list[str]]:
        values = self.factors.parameters(self._columns())
        return {name: [f"{value:.12g}" for value in column] for name, column in values.items()}

    def _columns(self) -> dict[str, np.ndarray]:
        """Values of the laws."""
        columns = (law.values(column) for law, column in zip(self.laws, self.shares.T, strict=True))
        rounded = [np.array([float(f"{value:.12g}") for value in column]) for column in columns]
        return {law.name: column for law, column in zip(self.laws, rounded, strict=True)}


def read_plan(file: Path, exact: int | None = None) -> TolerancePlan:
    """The plan in a study file with a table ``[tolerance]``, whose own ``exact`` counts if none is given here.

    Raises
    ------
    InputError
        if it is not such a study, or a distribution exceeds the range of its parameter.
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
            raise InputError(f"{name} is not allowed in a tolerance study.")
    folder = file.resolve().parent
    given = scene.get("define", {})
    factors = read_factors(table["of"], {**parameters_in(str(scene.get("scene")), folder), **given})
    # What is scaled varies, and so has no other value.
    scene["define"] = {name: value for name, value in given.items() if name not in factors.constants}
    at_mean = factors.parameters({law.name: law.mean for law in factors.laws})
    scene["together"] = {name: [f"{value:.12g}"] for name, value in at_mean.items()}
    batch = batch_from(content, 0, folder)
    shares = _shares(table.get("samples", SAMPLES), table.get("sampling", SAMPLINGS[0]), len(factors.laws), batch.seed)
    count = _exact(table.get("exact", len(shares)) if exact is None else exact, len(shares))
    plan = TolerancePlan(factors, _force(batch), shares, count, replace(batch, name="nominal"))
    for law in factors.laws:
        _check_range(plan, law)
    return plan


def _shares(samples: Any, sampling: Any, parameters: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc

    check_whole("samples", samples, FEWEST, MOST)
    if sampling not in SAMPLINGS:
        raise InputError(f"sampling = {sampling!r} is not allowed: one of {', '.join(SAMPLINGS)} is needed.")
    if sampling == "sobol" and samples & (samples - 1):
        raise InputError(f"samples = {samples} is not allowed with sampling sobol: a power of 2 is needed.")
    engine = {"latin_hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol}[sampling]
    return engine(parameters, seed=np.random.default_rng(seed)).random(samples)


def _exact(exact: Any, samples: int) -> int:
    """The number of samples to be computed.

    Those are the first ones, a fair part of all: rows of a Latin hypercube are in random order, and the beginning of a
    scrambled Sobol' sequence is such a sequence itself.
    """
    if not (is_whole(exact) and FEWEST <= exact <= samples):
        raise InputError(
            f"exact = {exact!r} is not allowed: a whole number from {FEWEST} to {samples}, the number of samples, is "
            "needed."
        )
    return exact


def _force(batch: Batch) -> str:
    """The varied force: nothing else may be varied, and it has at least two values."""
    axes = [axis for axis in batch.axes if axis.dim != STEP]
    if not axes:
        return ""
    (first, *others) = axes
    if others or not first.is_force or first.size < 2 or first.is_open:
        raise InputError(
            f"vary = {', '.join(axis.dim for axis in axes)} is not allowed in a tolerance study: one component of the "
            "force, with two values or more, or nothing."
        )
    return first.dim


def _check_range(plan: TolerancePlan, law: Law) -> None:
    """Refuse a distribution that exceeds the range of its parameter, with others at their mean."""
    mean = {each.name: each.mean for each in plan.laws}
    for end in (BEYOND, 1 - BEYOND):
        value = float(law.values(np.array(end)))
        parameters = plan.factors.parameters({**mean, law.name: value})
        reason = refusal_of(plan.batch.scene({name: f"{number:.12g}" for name, number in parameters.items()}))
        if reason:
            raise InputError(f"tolerance of {law.name}: {law.words} leaves what is allowed at {value:.4g}: {reason}")
