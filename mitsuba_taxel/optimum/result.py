"""Result of an optimisation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.convergence import ORDER
from mitsuba_taxel.electronics import saturation_force, total_noise
from mitsuba_taxel.electronics.noise import resolution_notes
from mitsuba_taxel.electronics.response import lit
from mitsuba_taxel.optimum.designs import DesignEvaluation
from mitsuba_taxel.optimum.figures import SATURATION, TO_THE_END, DesignResponses, end_of, noise_equivalent_force
from mitsuba_taxel.optimum.optimiser import HELD, Optimiser, with_rates, worst_of
from mitsuba_taxel.optimum.plan import Design, Plan
from mitsuba_taxel.optimum.search import BALANCED, Stationarity
from mitsuba_taxel.optimum.verification import FINER, FineDescent, MeshVerification

if TYPE_CHECKING:
    import pandas

EXTRAPOLATED = 1 / (1 - FINER**ORDER)
"""Error of a figure, relative to its change on the finer mesh."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Result of `optimise`: the best design compared with the first, and all evaluated designs.

    Attributes
    ----------
    before, best : dict[str, str]
        Parameters of the original scene, and of the best design.
    figures : DataFrame
        One row for the objective and each constraint: ``unit``; ``before`` and ``best``, their worst components;
        ``before_finer`` and ``best_finer``, their worst components on a finer mesh; ``error``, the error of ``best``
        due to its elements and the noise of its light, extrapolated from the change on the finer mesh, NaN without a
        finer mesh; ``multiplier``, the relative gain of the objective, to first order, if the bound were relaxed by 100
        %: above 0 if the constraint is active.
    variables : DataFrame
        One row per variable: ``low``, ``high``, ``before``, ``best``, and the active bound, ``at``; NaN if a design
        does not have the variable.
    slopes : DataFrame
        Derivatives of the worst components at the best design, one row per figure and variable of that design.
    history : DataFrame
        One row per design, in order, with the number of the ``descent`` that evaluated it first (0 for the initial
        designs), the number of the design that was meshed for it (``mesh_of``; its own number if the mesh was not
        moved), and the ``best`` value of the objective so far.
    front : DataFrame
        Pareto front of the objective and another objective, with parameters; empty if not requested.
    gain, gain_error, probability : float
        Relative improvement of the objective on the finer mesh; its change due to that mesh; and the probability of an
        improvement, with that change as standard deviation.
    unbalanced, unbalanced_error : float
        Slope of the objective that remains within constraints and bounds, as its relative change over the width of the
        bounds; 0 at an optimum. And its standard error, NaN if only one gradient is known.
    beyond : float
        Relative gain of the objective by a further descent from the best design, on the finer mesh. It is made only if
        the remaining slope does not show a local optimum; NaN without this descent.
    beyond_ended : bool
        Whether this descent ended because it found no further improvement.
    gradients : int
        Number of gradients that are averaged for the remaining slope: the gradient of the best design, those of close
        designs on other meshes (within 2 % of the bounds, one for each mesh), and the gradient on the finer mesh.
    load_steps : int
        Number of load steps computed for all designs, without the finer mesh.
    seconds : float
        Time of the jobs of these load steps.
    design_seconds : list[float]
        Time of each design of the history in s; 0 for designs refused before any job.
    warnings, notes : list[str]
    """

    before: dict[str, str]
    best: dict[str, str]
    figures: pandas.DataFrame
    variables: pandas.DataFrame
    slopes: pandas.DataFrame
    history: pandas.DataFrame
    front: pandas.DataFrame
    gain: float
    gain_error: float
    probability: float
    unbalanced: float
    unbalanced_error: float
    beyond: float
    beyond_ended: bool
    gradients: int
    load_steps: int
    seconds: float
    design_seconds: list[float]
    warnings: list[str]
    notes: list[str]

    @property
    def is_local(self) -> bool:
        """Whether slope and error show that the best design is a local optimum."""
        return self.unbalanced + self.unbalanced_error <= BALANCED


def make_optimum(
    optimiser: Optimiser, best: Design, verification: MeshVerification, trade_offs: pandas.DataFrame | None
) -> Optimum:
    """Create the result: the best design compared with the first, with multipliers, errors, warnings and notes.

    Parameters
    ----------
    optimiser : Optimiser
        The optimisation.
    best : Design
        Best design of the run.
    verification : MeshVerification
        Both designs on a finer mesh; a descent on it follows if the slope does not show a local optimum.
    trade_offs : DataFrame or None
        Pareto front.
    """
    import pandas

    # Notes on the evaluation and on what ends ranges.
    plan, before, notes = optimiser.plan, optimiser.before, list(optimiser.designs.notes)
    if plan.tolerances:
        names = ", ".join(plan.tolerances)
        notes.append(f"90 % of all sensors reach the stated figures, to first order in the tolerances of {names}")
    notes += [note for note in verification.notes if note not in notes]
    reads = {"before": optimiser.read(before), "best": optimiser.read(best)} | verification.reads
    notes += _ends(optimiser, verification, reads)
    notes += circuit_notes(reads["best"].values, {name: along for name, (along, _) in plan.lines.items()})

    # Multipliers of the constraints, and a descent on the finer mesh if they do not show a local optimum.
    conditions = optimiser.stationarity(best, *verification.finer)
    fine_descent = None if conditions.is_local else verification.descend()
    sizes = [len(limit.figure.components(reads["best"].values)) for limit in plan.limits]
    of_limits = np.split(conditions.limits, np.cumsum(sizes)[:-1]) if sizes else []
    multipliers = [float(components.sum()) for components in of_limits]

    # The table of figures, and the improvement of the first, the objective.
    criteria = plan.criteria
    figures = pandas.DataFrame(
        {
            "figure": [criterion.words for criterion in criteria],
            "unit": [criterion.figure.unit for criterion in criteria],
            **{name: [worst_of(criterion, read) for criterion in criteria] for name, read in reads.items()},
            "multiplier": [math.nan, *multipliers],
        }
    )
    figures["error"] = EXTRAPOLATED * (figures.best_finer - figures.best).abs() if verification.finer else math.nan
    gain, error, probability = _gain(figures, plan.goal.sign)
    base = plan.base
    return Optimum(
        before={**base, **plan.parameters(before)},
        best={**base, **plan.parameters(best)},
        figures=figures,
        variables=_variables(plan, before, best, conditions),
        slopes=_slopes(plan, best, reads["best"]),
        history=pandas.DataFrame(optimiser.rows()),
        front=pandas.DataFrame() if trade_offs is None else trade_offs,
        gain=gain,
        gain_error=error,
        probability=probability,
        unbalanced=conditions.unbalanced,
        unbalanced_error=conditions.error,
        beyond=math.nan if fine_descent is None else fine_descent.gain,
        beyond_ended=fine_descent is not None and fine_descent.ended,
        gradients=conditions.gradients,
        load_steps=optimiser.designs.loads,
        seconds=optimiser.designs.seconds,
        design_seconds=[optimiser.designs.seconds_of.get(design, 0.0) for design in optimiser.history],
        warnings=_warnings(optimiser, conditions, fine_descent, probability, reads),
        notes=notes,
    )


def _ends(optimiser: Optimiser, verification: MeshVerification, reads: Mapping[str, DesignEvaluation]) -> list[str]:
    """Text lines on measuring ranges and first contacts: the value at the best design, its error, and what ends the
    range."""
    notes = []
    finer = "best_finer" if verification.finer else "best"
    for figure in {figure.words: figure for figure in optimiser.plan.figures if figure.kind in TO_THE_END}.values():
        ends = [figure.components(reads[name].values).real.min() for name in ("best", finer)]
        error = "" if finer == "best" else f" ± {EXTRAPOLATED * abs(ends[1] - ends[0]):.2g} (from the finer mesh)"
        notes.append(f"{figure.words}: {ends[0]:.4g}{error} {figure.unit}, {end_of(figure, reads['best'].values)}")
        if figure.parameters["along"] in optimiser.designs.no_contact:
            why = optimiser.designs.no_contact[figure.parameters["along"]]
            notes.append(f"{figure.words} is limited by saturation only, as the first contact is unknown: {why}")
    return notes


def circuit_notes(responses: DesignResponses, along: Mapping[str, str]) -> list[str]:
    """Notes on noise and saturation of the circuit along each line of loads; empty without a circuit.

    Parameters
    ----------
    responses : DesignResponses
        Readings of a design.
    along : Mapping[str, str]
        Parameter that changes along each line, by the name of the line.
    """
    if responses.circuit is None:
        return []
    notes = [f"one count: {responses.circuit.step:.4g} V"]
    for name, line in responses.lines.items():
        if len(line.values) > 1:
            with np.errstate(divide="ignore", invalid="ignore"):
                noise = noise_equivalent_force(responses, name).real.reshape(line.power.shape)[0]
            noises = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (noise.min(), noise.max())))
            saturated = saturation_force(responses.circuit, line.values, line.power.real)
            where = "nowhere"
            if np.isfinite(saturated).any():
                first = int(np.nanargmin(np.abs(saturated)))
                where = f"from {along[name]} = {saturated[first]:.4g} on (taxel {first + 1})"
            notes.append(f"along {name}: noise of the first reading as {along[name]}: {noises}; saturated {where}")
    noise = [total_noise(responses.circuit, lit(line.power.real)).ravel() for line in responses.lines.values()]
    return [*notes, *resolution_notes(responses.circuit.step, np.concatenate(noise))]


def _gain(figures: pandas.DataFrame, sign: int) -> tuple[float, float, float]:
    """Relative improvement of the objective, its error, and the probability that it is positive."""
    from scipy.stats import norm

    goal = figures.iloc[0]
    if "best_finer" not in goal:
        return -sign * (goal.best - goal.before) / abs(goal.before), math.nan, math.nan
    scale = abs(goal.before_finer)
    gain = -sign * (goal.best_finer - goal.before_finer) / scale
    error = math.hypot(goal.best_finer - goal.best, goal.before_finer - goal.before) / scale
    return gain, error, float(norm.cdf(gain / error)) if error > 0 else float(gain > 0)


def _variables(plan: Plan, before: Design, best: Design, conditions: Stationarity) -> pandas.DataFrame:
    import pandas

    at = ["low" if force < 0 else "high" if force > 0 else "" for force in conditions.bounds]
    return pandas.DataFrame(
        {
            "variable": [variable.name for variable in plan.variables],
            "low": [variable.low for variable in plan.variables],
            "high": [variable.high for variable in plan.variables],
            **{
                when: [plan.values(design).get(variable.name, math.nan) for variable in plan.variables]
                for when, design in (("before", before), ("best", best))
            },
            "at": at,
        }
    )


def _slopes(plan: Plan, best: Design, read: Any) -> pandas.DataFrame:
    import pandas

    rows = []
    for criterion in plan.criteria:
        values, rates = with_rates(criterion.figure, read)
        if not values.size:
            continue
        worst = int((criterion.sign * values).argmax())
        for variable, rate, applies in zip(plan.variables, rates[worst], plan.has(best.choice), strict=True):
            if applies:
                slope = rate / (variable.high - variable.low)
                rows.append(
                    {"figure": criterion.words, "variable": variable.name, "slope": slope, "over_the_bounds": rate}
                )
    return pandas.DataFrame(rows, columns=["figure", "variable", "slope", "over_the_bounds"])


def _broken(optimiser: Optimiser, read: DesignEvaluation) -> str:
    """Text with the constraints that a design violates; empty if it meets all."""
    worst = [(limit, worst_of(limit, read)) for limit in optimiser.plan.limits]
    violated = [
        (limit, at) for limit, at in worst if limit.sign * (at - limit.bound) > HELD * (abs(limit.bound) or 1.0)
    ]
    return " and ".join(f"{limit.words} ({at:.4g})" for limit, at in violated)


def _gained(fine_descent: FineDescent | None) -> str:
    """End of a sentence of a warning: how much a further descent on the finer mesh has gained."""
    if fine_descent is None:
        return "; more evaluations may improve the design, or readings are too inaccurate to show it"
    end = "finds no better design" if fine_descent.ended else "may gain more with more evaluations"
    gain = f"{fine_descent.gain:.2%} with {fine_descent.designs} designs"
    return f"; on the finer mesh, a further descent from it gains {gain}, and {end}"


def _warnings(
    optimiser: Optimiser,
    conditions: Stationarity,
    fine_descent: FineDescent | None,
    probability: float,
    reads: Mapping[str, DesignEvaluation],
) -> list[str]:
    """Warnings for the user: violated constraints, an uncertain optimum or improvement, saturation, and failed designs.
    """
    warnings = []
    if "best_finer" in reads and (broken := _broken(optimiser, reads["best_finer"])):
        warnings.append(f"on the finer mesh the best design violates {broken}")
    if math.isnan(conditions.error):
        warnings.append(
            f"the best design may not be a local optimum: its slope is known on one mesh only{_gained(fine_descent)}"
        )
    elif not conditions.is_local:
        warnings.append(
            "the best design may not be a local optimum: over the width of the bounds, its remaining slope may change "
            f"the objective by up to {conditions.unbalanced + conditions.error:.0%}"
            f"{_gained(fine_descent)}"
        )
    if probability < 0.95 and (broken := _broken(optimiser, reads["before"])):
        warnings.append(f"the first design violates {broken}: the best design was chosen among those that meet it")
    elif probability < 0.95:
        warnings.append(f"the best design is better than the first one with a probability of {probability:.0%} only")
    if any(limit.figure.kind == SATURATION and worst_of(limit, reads["before"]) > 1 for limit in optimiser.plan.limits):
        warnings.append("the first design saturates: its figures are computed as if the converter had no full scale")
    failures = optimiser.designs.failures
    if failures:
        warnings.append(
            f"{len(failures)} of {len(optimiser.history)} designs could not be read (reasons in history.csv); the "
            f"first: {next(iter(failures.values()))}"
        )
    return warnings
