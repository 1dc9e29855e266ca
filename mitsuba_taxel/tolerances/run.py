"""Tolerance studies: samples of a sensor through the whole chain, and the linear estimate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from mitsuba_taxel.base.arguments import check_flags, check_progress, path_of
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.plots.figures import save_figure
from mitsuba_taxel.plots.spreads import plot_spreads
from mitsuba_taxel.sensing.derivatives.derivable import without_derivative
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.vary import STEP
from mitsuba_taxel.studies.run.pool import open_pool
from mitsuba_taxel.studies.run.study import Progress, run_batch
from mitsuba_taxel.studies.store.folder import begin_tree
from mitsuba_taxel.tolerances.analysis import Tolerance, analysed, is_smooth
from mitsuba_taxel.tolerances.plan import TolerancePlan, read_plan

if TYPE_CHECKING:
    import pandas


def run_tolerance(
    file: str | Path,
    output: str | Path,
    *,
    exact: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Tolerance:
    """Propagate the tolerances of a scene's parameters, given as distributions, to its readings.

    Each random sample of the sensor is a job of a study in ``output``. The same call resumes an interrupted run; a call
    with a larger ``exact`` computes the missing samples.

    Parameters
    ----------
    file : str or Path
        A study file of one scene with tables ``[tolerance]`` and ``[tolerance.of]``.
    output : str or Path
        Folder for the results; new, empty, or that of the same study.
    exact : int, optional
        Number of samples that are computed by mechanics and light, from 8 to all; by default ``exact`` in the table
        ``[tolerance]``, or all samples. The other samples get a linear estimate from derivatives. Mean, spread and
        quantiles are then those of the linear estimates of all samples, corrected by the exact samples.
    workers : int, optional
        Number of processes to use, in place of this one.
    scheduler : str, optional
        Address of a Dask scheduler whose workers to use; they need access to the same files.
    retry_failed : bool
        Whether samples that failed in an earlier call are computed again.
    progress : Callable[[Progress], None], optional
        Called after each sample.

    Returns
    -------
    Tolerance
        Mean, spread, quantiles and Sobol' indices of the readings, which are also written to ``output``.

    Raises
    ------
    InputError
        if the study or the folder is refused, or a distribution exceeds the range of its parameter.
    ComputationError
        if too few samples could be computed.
    """
    file, folder = path_of("file", file), path_of("output", output)
    check_flags(retry_failed=retry_failed)
    check_progress(progress)
    plan = read_plan(file, exact)
    with open_pool(workers, scheduler) as pool:
        nominal, notes = _with_derivatives(plan)
        begin_tree(folder, _as_tree(plan))
        mean = run_batch(nominal, pool, folder / "nominal", retry_failed, False, progress)
        if mean.attrs["failures"]:
            raise ComputationError(f"the sensor with parameters at their mean cannot be read: {mean.attrs['failures']}")
        samples = run_batch(_like(mean, plan), pool, folder / "samples", retry_failed, False, progress)
    result = analysed(plan, mean, samples.isel({STEP: slice(plan.exact)}), notes)
    _write(result, folder)
    return result


def _like(mean: xr.Dataset, plan: TolerancePlan) -> Batch:
    """Batch of the samples, with the number of points and the mesh size of the mean sensor, without random numbers if
    possible."""
    points = 0 if is_smooth(mean) else int(mean.attrs["points"])
    return plan.samples(points, mean.attrs.get("mesh_size"))


def _as_tree(plan: TolerancePlan) -> dict[str, Any]:
    """Both batches as the content of a study of two scenes, for ``open_study`` and ``taxel status``."""
    tables = ("scene", "define", "vary", "together")
    contents = {batch.name: batch.as_toml() for batch in (plan.batch, plan.samples(1, None))}
    shared = {name: value for name, value in contents["nominal"].items() if name not in tables}
    scenes = [
        {"name": name, **{key: content[key] for key in tables if key in content}} for name, content in contents.items()
    ]
    return {**shared, "scenes": scenes}


def _with_derivatives(plan: TolerancePlan) -> tuple[Batch, list[str]]:
    """The batch of the mean sensor with all available derivatives, and a note for each parameter without one."""
    values = {name: words[0] for axis in plan.batch.axes for name, words in axis.values.items()}
    names = list(plan.factors.products)
    refused = without_derivative(plan.batch.scene(values), names)
    notes = [f"no linear estimate for {name}: {reason}" for name, reason in refused.items()]
    return replace(plan.batch, derivatives=tuple(name for name in names if name not in refused)), notes


def _write(result: Tolerance, folder: Path) -> None:
    for name, table in _tables(result):
        with replacing(folder / f"{name}.csv") as file:
            table.to_csv(file, index=False)
    write_text(folder / "notes.txt", "".join(f"{line}\n" for line in result.notes))
    save_figure(plot_spreads(result.spread, result.parameters), folder, "tolerance")


def _tables(result: Tolerance) -> Iterator[tuple[str, pandas.DataFrame]]:
    for name in ("spread", "shares", "parameters", "samples"):
        yield name, getattr(result, name)
