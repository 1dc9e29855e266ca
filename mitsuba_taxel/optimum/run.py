"""Optimisation of a study file with variables, objective and constraints, to the best design and its verification."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.arguments import check_flags, check_progress, path_of
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.optimum.designs import DesignEvaluator, pads_of
from mitsuba_taxel.optimum.figures import OF_CHANGES, RANGE, SATURATION, Figure
from mitsuba_taxel.optimum.front import front
from mitsuba_taxel.optimum.optimiser import OptimisationProgress, Optimiser, worst_of
from mitsuba_taxel.optimum.outputs import write
from mitsuba_taxel.optimum.plan import Design, Goal, Limit, Plan
from mitsuba_taxel.optimum.plan_file import read_plan
from mitsuba_taxel.optimum.result import Optimum, make_optimum
from mitsuba_taxel.optimum.search import least_violation
from mitsuba_taxel.optimum.verification import verified_on_finer_mesh
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.studies.run.pool import open_pool

IN_VIEW = 2.0
"""Least angle, in degrees, between roofs with a profile and rays from the middle of their cell's opening."""
UNSATURATED = 0.99
"""Largest output, relative to the limit of the circuit."""


def optimise(
    file: str | Path,
    output: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    progress: Callable[[OptimisationProgress], None] | None = None,
) -> Optimum:
    """Find the design of a scene with the best objective within bounds and constraints.

    Designs are improved by gradient-based descents from several starts. Every load step of every design is a job of a
    study in ``output``. The same call resumes an interrupted optimisation.

    Parameters
    ----------
    file : str or Path
        A study file of one scene with a table ``[optimise]``.
    output : str or Path
        Folder for the results: a new or empty folder, or a folder with results of the same scene, whose readings are
        reused.
    workers : int, optional
        Number of processes to use instead of this process.
    scheduler : str, optional
        Address of a Dask scheduler whose workers are used; they need access to the same files.
    retry_failed : bool
        Whether load steps that failed in an earlier call are computed again.
    progress : Callable[[OptimisationProgress], None], optional
        Called after each design.

    Returns
    -------
    Optimum
        The best design, its figures and their errors, which are also written to ``output``.

    Raises
    ------
    InputError
        if the study or the folder is refused, no pad is possible within the bounds, or constraints contradict each
        other.
    ComputationError
        if all designs failed.
    """
    file, folder = path_of("file", file), path_of("output", output)
    check_flags(retry_failed=retry_failed)
    check_progress(progress)

    # The plan, with constraints that exclude designs that cannot be computed.
    plan = read_plan(file)
    initial = plan.initial_designs()
    plan = _unsaturated(_in_view(plan, initial))
    make_folder(folder)
    with open_pool(workers, scheduler) as pool, ExitStack() as at_the_end:
        designs = DesignEvaluator(plan, pool, folder / "designs", retry_failed)
        at_the_end.callback(designs.write_tables)
        optimiser = Optimiser(plan, designs, progress)

        # Descents from all initial designs, then the front, whose descents may find a better design.
        starts = readable_starts(optimiser, initial)
        _check_figures(optimiser, starts)
        for start in starts:
            optimiser.descend(start, plan.goal, plan.limits)
        best = optimiser.best(plan.goal, plan.limits)
        if best is None:
            raise _no_design(optimiser)
        trade_offs = None if plan.front is None else front(optimiser, *plan.front)
        best = optimiser.best(plan.goal, plan.limits) or best

        # The best design is evaluated again without a moved mesh, then on a finer mesh.
        optimiser.evaluate([best.alone])
        verification = verified_on_finer_mesh(optimiser, best, pool, folder / "judged")
        at_the_end.callback(verification.optimiser.designs.write_tables)
        result = make_optimum(optimiser, best, verification, trade_offs)
    write(plan, optimiser.before, best, result, folder)
    return result


def _in_view(plan: Plan, designs: list[Design]) -> Plan:
    """Add a constraint to the plan that keeps all of a roof with a profile visible from the cell's opening, because
    scenes require this. A plan with such a constraint is unchanged.
    """
    has_limit = any(limit.figure.kind == "view_angle" for limit in plan.limits)
    if has_limit or not any(pad.profile for design in designs for pad in pads_of(plan.scene(design))):
        return plan
    return replace(plan, limits=[*plan.limits, Limit(Figure("view_angle", {}, "degrees"), -1, IN_VIEW)])


def _unsaturated(plan: Plan) -> Plan:
    """Add constraints to the plan that keep the output below the circuit's limit.

    Constraints are added along each line of loads that a figure uses, such as a sensitivity, unless the plan has such a
    constraint. Without them, figures of a saturated sensor would be computed as if the converter had no limit.
    """
    if plan.circuit is None:
        return plan
    upper = [limit for limit in plan.limits if limit.figure.kind == SATURATION and limit.sign * limit.bound <= 1]
    limited = {limit.figure.parameters["along"] for limit in upper if limit.sign > 0}
    used = [
        figure.parameters[key]
        for figure in plan.figures
        if figure.kind in OF_CHANGES
        for key in ("along", "by")
        if key in figure.parameters
    ]
    lines = dict.fromkeys(line for along in used for line in ([along] if isinstance(along, str) else along))
    added = [Limit(Figure(SATURATION, {"along": line}, "1"), 1, UNSATURATED) for line in lines if line not in limited]
    return replace(plan, limits=[*plan.limits, *added])


def readable_starts(optimiser: Optimiser, initial: list[Design]) -> list[Design]:
    """Select the initial designs that can be evaluated.

    If none of them can be evaluated, further designs are tried, at most as many as a descent may evaluate; the first
    design that can be evaluated is then returned.

    Raises
    ------
    ComputationError
        if all designs fail.
    """
    plan = optimiser.plan
    readable = [design for design, read in zip(initial, optimiser.evaluate(initial), strict=True) if read is not None]
    additional = [] if readable else replace(plan, starts=plan.starts + plan.evaluations).initial_designs()
    for design in additional:
        if optimiser.evaluate([design]) != [None]:
            return [design]
    if not readable:
        why = next(iter(optimiser.designs.failures.values()))
        raise ComputationError(
            "the search cannot start, because no reading could be computed for any of "
            f"{len(optimiser.history)} designs. The first one failed: {why}"
        )
    return readable


def _check_figures(optimiser: Optimiser, starts: list[Design]) -> None:
    """Raise `InputError` if a figure of the study cannot be computed for this scene."""
    reads = [optimiser.read(design) for design in starts]
    for criterion in [*optimiser.plan.criteria, *([optimiser.plan.front[0]] if optimiser.plan.front else [])]:
        try:
            components = [criterion.figure.components(read.values) for read in reads]
        except IndexError:
            count = min(line.power.shape[-1] for read in reads for line in read.values.lines.values())
            raise InputError(
                f"{criterion.figure.words} cannot be computed: taxel = {criterion.figure.parameters.get('taxel')} of "
                f"this figure in the study file is not allowed: the taxels of the scene have the numbers 1 to {count}."
            ) from None
        no_contact = optimiser.designs.no_contact.get(criterion.figure.parameters.get("along", ()))
        if no_contact and criterion.figure.kind == RANGE and not any(values.size for values in components):
            raise InputError(f"{criterion.figure.words} cannot be computed without a table [circuit]: {no_contact}")
        applies = [values.size > 0 for values in components]  # a constraint may apply to some choices only
        is_defined = all(applies) if isinstance(criterion, Goal) else any(applies)
        if not (is_defined and all(np.isfinite(values).all() for values in components)):
            raise InputError(
                f"{criterion.figure.words} cannot be computed for this scene, as its value is not "
                f"finite: choose another figure or other loads."
            )


def _no_design(optimiser: Optimiser) -> InputError:
    """Create the error that no design meets all constraints."""
    # Multipliers at the design with the least violation show which constraints are in conflict.
    plan = optimiser.plan
    nearest, linearisation = optimiser.nearest(plan.goal, plan.limits)
    x = np.array(nearest.x)
    _, _, weights = least_violation(linearisation, -x, 1 - x)
    sizes = [len(limit.figure.components(optimiser.read(nearest).values)) for limit in plan.limits]
    ends = np.cumsum(sizes)[:-1]
    of_limits = [float(components.sum()) for components in np.split(weights, ends)]
    order = np.argsort(of_limits)[::-1]
    conflicting = [plan.limits[number] for number in order[:2] if of_limits[number] > 1e-6]
    what = "in conflict within the bounds" if len(conflicting) > 1 else "beyond reach within the bounds"
    if not conflicting:
        broken = [components.min(initial=0.0) for components in np.split(linearisation.limits, ends)]
        conflicting = [plan.limits[int(np.argmin(broken))]]
        what = "met by no design yet, but more evaluations or starts may find one"
    said = " and ".join(
        f"{limit.words} (nearest: {worst_of(limit, optimiser.read(nearest)):.4g})" for limit in conflicting
    )
    remedy = "Relax one of them, or widen the bounds."
    if all(limit.figure.kind == SATURATION for limit in conflicting):
        # The constraint may have been added by `_unsaturated`.
        remedy = "Lower the gain of the table [circuit] (load_resistance, transfer, buffer_gain), or widen the bounds."
    return InputError(f"constraints {what}: {said}; {len(optimiser.history)} designs evaluated. {remedy}")
