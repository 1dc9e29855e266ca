"""Fits: from a study file with measured data to unknowns with confidence intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.arguments import check_progress, path_of
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.fitting.model import ReadingModel
from mitsuba_taxel.fitting.model_error import ModelError, carried
from mitsuba_taxel.fitting.plan import FitPlan, read_plan
from mitsuba_taxel.fitting.solve import LeastSquares, interval, lack_of_fit_warnings, misfit_warnings, solve
from mitsuba_taxel.plots.figures import save_figure
from mitsuba_taxel.plots.residuals import plot_residuals
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.sensing.scene.finding import is_file
from mitsuba_taxel.sensing.scene.parameter_roles import roles_of_parameters
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters
from mitsuba_taxel.studies.plan.batch import loads_among
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.studies.run.pool import open_pool

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class FitResult:
    """Result of `run_fit`: estimated unknowns with their errors, and the residuals.

    Attributes
    ----------
    unknowns : DataFrame
        One row per unknown: ``start``; ``value``, its ``error`` (one standard deviation), and the ends ``low`` and
        ``high`` of its 95 % confidence interval. Error and interval include ``data_error``, due to the data, and
        ``model_error``, due to the model. ``model_error`` consists of ``light_error``, ``mechanics_error`` and
        ``geometry_error``; unknown errors are NaN and not included.
    correlation : DataFrame
        Correlation of the unknowns' errors due to the data.
    residuals : DataFrame
        One row per row of the data and taxel: its settings, ``measured``, ``model`` and ``residual``, in ``unit``, and
        ``in_errors``, the residual divided by the error of the data or, if it is unknown, by the root mean square of
        the residuals.
    misfit : float
        Sum of squares of ``in_errors`` per degree of freedom: about 1 if model and errors are right. NaN if the errors
        of the data are unknown.
    warnings : list[str]
        Unknowns that the data do not determine, and other warnings.
    notes : list[str]
        Further notes for the reader.
    """

    unknowns: pandas.DataFrame
    correlation: pandas.DataFrame
    residuals: pandas.DataFrame
    misfit: float
    warnings: list[str]
    notes: list[str]


def run_fit(
    file: str | Path,
    output: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> FitResult:
    """Estimate unknown parameters of a scene from measured readings, by weighted least squares.

    Parameters
    ----------
    file : str or Path
        A study file of one scene with tables ``[fit]`` and ``[fit.unknowns]``.
    output : str or Path
        Folder for the results.
    workers : int, optional
        Number of processes to use instead of this process.
    scheduler : str, optional
        Address of a Dask scheduler whose workers are used; they need access to the same files.
    progress : Callable[[int], None], optional
        Called with the number of model evaluations.

    Returns
    -------
    FitResult
        Estimates with the errors of data and model, which are also written to ``output``.

    Raises
    ------
    InputError
        if the study, its data or the folder is refused.
    ComputationError
        if the scene cannot be read for some values of the unknowns.
    """
    file, folder = path_of("file", file), path_of("output", output)
    check_progress(progress)
    plan = read_plan(file)
    make_folder(folder)
    with open_pool(workers, scheduler) as pool:
        model = ReadingModel(plan, pool)
        shape = plan.data.readings.shape

        def flat(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            readings, jacobian = model(unknowns)
            if progress:
                progress(model.calls)
            return readings.ravel(), jacobian.reshape(-1, len(unknowns))

        errors = None if plan.data.errors is None else plan.data.errors.ravel()
        solution = solve(flat, plan.data.readings.ravel(), errors, plan.unknowns)
        of_model = model.errors(solution.values, solution.by_reading.reshape(-1, *shape))
        if progress:
            progress(model.calls)
    result = _result(plan, model, solution, of_model, shape)
    _write(result, folder, plan)
    return result


def _result(
    plan: FitPlan, model: ReadingModel, solution: LeastSquares, of_model: ModelError, shape: tuple[int, ...]
) -> FitResult:
    """Assemble the result of a fit: its tables, warnings and notes.

    Parameters
    ----------
    plan : FitPlan
        The fit.
    model : ReadingModel
        Model of the fit, which lists unknowns without derivatives and unknowns whose effect is below the noise.
    solution : LeastSquares
        Estimates with the errors of the data.
    of_model : ModelError
        Errors of the model's readings at the estimates.
    shape : tuple[int, ...]
        (rows, taxels) of the data.
    """
    import pandas

    # Unknowns, with the errors of data and model.
    names, data = [unknown.name for unknown in plan.unknowns], plan.data
    by_model = carried(of_model)
    hidden = np.array([name in model.hidden for name in names])
    by_model = by_model._replace(light=np.where(hidden, np.inf, by_model.light))
    half_width = interval(solution, by_model.total)
    unknowns = pandas.DataFrame(
        {
            "unknown": names,
            "start": [unknown.start for unknown in plan.unknowns],
            "value": solution.values,
            "error": np.hypot(solution.errors, by_model.total),
            "low": solution.values - half_width,
            "high": solution.values + half_width,
            "data_error": solution.errors,
            "model_error": by_model.total,
            **{f"{source}_error": error for source, error in by_model._asdict().items()},
        }
    )

    # Residuals, one row for each row of the data and taxel.
    modelled = solution.model.reshape(shape)
    residual = data.readings - modelled
    error = np.full(shape, np.sqrt(solution.misfit)) if data.errors is None else data.errors
    rows: list[dict[str, Any]] = [
        {
            **{name: words[row] for name, words in data.settings.items()},
            "taxel": int(taxel),
            "unit": data.unit,
            "measured": data.readings[row, column],
            "model": modelled[row, column],
            "residual": residual[row, column],
            "in_errors": residual[row, column] / error[row, column] if error[row, column] > 0 else 0.0,
        }
        for row in range(data.rows)
        for column, taxel in enumerate(data.taxels)
    ]

    # Warnings and notes.
    warnings = list(solution.warnings)
    freedom, model_errors = solution.degrees_of_freedom, of_model.of_rows().reshape(shape)
    if data.errors is None:
        warnings += lack_of_fit_warnings(residual, data.settings, model_errors, freedom)
    else:
        warnings += misfit_warnings(residual.ravel(), data.errors.ravel(), model_errors.ravel(), freedom)
    if np.isnan(of_model.mechanics).any():
        warnings.append("intervals do not include the error of the model's finite elements, which is unknown")
    warnings += [
        f"the noise of the model's light hides the effect of {name}, whose error is unknown: more points are needed"
        for name in names
        if name in model.hidden
    ]
    notes = [
        f"derivatives with respect to {name} are differences of noisy readings ({why})"
        for name, why in model.refused.items()
    ]
    notes.append(LEFT_OUT["fit"])
    return FitResult(
        unknowns,
        pandas.DataFrame(solution.correlation, index=names, columns=names),
        pandas.DataFrame(rows),
        float("nan") if data.errors is None else solution.misfit,
        warnings,
        notes,
    )


def _write(result: FitResult, folder: Path, plan: FitPlan) -> None:
    tables = {"fit": result.unknowns, "residuals": result.residuals}
    for name, table in tables.items():
        with replacing(folder / f"{name}.csv") as file:
            table.to_csv(file, index=False)
    with replacing(folder / "correlation.csv") as file:
        result.correlation.to_csv(file)
    notes = [*(f"warning: {line}" for line in result.warnings), *result.notes]
    write_text(folder / "notes.txt", "".join(f"{line}\n" for line in notes))
    relative = plan.folder / plan.scene
    scene = find_scene(relative if is_file(relative) else plan.scene)
    units, loads = units_of_parameters(scene), loads_among(roles_of_parameters(scene))
    save_figure(plot_residuals(result.residuals, result.correlation, units, loads), folder, "fit")
