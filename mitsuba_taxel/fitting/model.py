"""Readings of a scene as a function of its unknowns, with derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.electronics import respond
from mitsuba_taxel.fitting.model_error import ModelError
from mitsuba_taxel.fitting.plan import CIRCUIT, FitPlan
from mitsuba_taxel.sensing.derivatives.derivable import without_derivative
from mitsuba_taxel.studies.plan.batch import Batch, make_batch
from mitsuba_taxel.studies.plan.vary import STEP
from mitsuba_taxel.studies.run.pool import Pool
from mitsuba_taxel.studies.run.study import run_batch
from mitsuba_taxel.studies.store.dataset import NOT_COMPUTED

STEP_SHARES = (0.02, 0.06, 0.2)
"""Relative steps of an unknown for differences of noisy readings; the first step whose change exceeds the noise is
used."""
RESOLVED = 4.0
"""Least ratio of a change of readings to its noise; the derivative is then accurate to 25 %."""
SMALL = 1e-6
"""Relative step of an unknown for differences without noise."""


class ReadingModel:
    """Model of a fit: a function of the unknowns that returns the readings of a scene, and their derivatives.

    Readings (rows, taxels) are those at the settings of each row of the data, their derivatives are (rows, taxels,
    unknowns). Derivatives with respect to parameters of the scene are computed without random numbers if possible,
    else as differences of readings that share their random numbers.

    Attributes
    ----------
    calls : int
        Number of evaluated studies.
    hidden : frozenset[str]
        Unknowns whose effect is below the noise.
    refused : dict[str, str]
        Reasons why derivatives with respect to an unknown are not available.
    """

    def __init__(self, plan: FitPlan, pool: Pool) -> None:
        self._plan, self._pool = plan, pool
        self._names = [unknown.name for unknown in plan.unknowns]
        self._in_scene = [number for number, unknown in enumerate(plan.unknowns) if unknown.in_scene]
        self.calls = 0
        self.hidden: frozenset[str] = frozenset()
        self._powers: dict[bytes, np.ndarray] = {}
        self._first_step: dict[int, int] = {}
        self._settings, self._setting_of_row = _distinct(plan)
        start = np.array([unknown.start for unknown in plan.unknowns])
        batch = self._batch(start)
        values = {name: words[0] for axis in batch.axes for name, words in axis.values.items()}
        scene_unknowns = [self._names[number] for number in self._in_scene]
        self.refused = without_derivative(batch.scene(values), scene_unknowns)
        self._by = [name for name in scene_unknowns if name not in self.refused]

    def __call__(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        power, rates = self._light(unknowns)
        self._powers[unknowns.tobytes()] = power
        shown, by_power = self._shown(unknowns, power)
        jacobian = np.zeros((*power.shape, len(unknowns)))
        jacobian[..., self._in_scene] = by_power[..., None] * rates
        for number, unknown in enumerate(self._plan.unknowns):
            if not unknown.in_scene:
                step = SMALL * (abs(unknowns[number]) or 1.0)
                ends = [self._shown(_shifted(unknowns, number, sign * step), power)[0] for sign in (1, -1)]
                jacobian[..., number] = (ends[0] - ends[1]) / (2 * step)
        return shown[self._setting_of_row], jacobian[self._setting_of_row]

    def errors(self, unknowns: np.ndarray, by_row: np.ndarray) -> ModelError:
        """Errors of the simulated readings at given values of the unknowns, from one more evaluation of the scene.

        Parameters
        ----------
        unknowns : (unknowns,) ndarray
            Values at which the model has been evaluated before.
        by_row : (unknowns, rows, taxels) ndarray
            Derivative of each unknown with respect to each reading of the data.
        """
        power = self._powers[unknowns.tobytes()]
        batch = replace(self._batch(unknowns), bare=False, derivatives=tuple(self._by))
        # Without random numbers, the error of the light is due to its patches. Random points would replace the patches.
        study = self._run(replace(batch, points=0) if self._by else batch)
        rate = self._shown(unknowns, power)[1]
        replicates, reading, light, total = (
            self._taxels(study, name) for name in ("replicate_power", "power", "standard_error", "total_error")
        )
        geometry = self._taxels(study, "geometry_error") if "geometry_error" in study else np.zeros_like(power)
        mechanics = np.sqrt(np.maximum(total**2 - light**2 - geometry**2, 0.0))
        # If readings were computed by another method or with another number of points, the difference counts as an
        # error.
        geometry = np.hypot(geometry, reading - power)
        # Rows of the same settings share their error.
        by_reading = np.zeros((len(unknowns), *power.shape))
        for row, setting in enumerate(self._setting_of_row):
            by_reading[:, setting] += by_row[:, row]
        size = np.abs(rate)
        return ModelError(rate * replicates, size * mechanics, size * geometry, by_reading, self._setting_of_row)

    def _light(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Power (settings, taxels) in W, and derivatives with respect to the unknowns of the scene."""
        study = self._read(unknowns, self._by)
        if self._by and "smooth_power" not in study:
            reasons = (line for line in study.attrs["notes"].splitlines() if line != NOT_COMPUTED)
            self.refused |= dict.fromkeys(self._by, "; ".join(reasons))
            self._by = []
        smooth = bool(self._by)
        power = self._taxels(study, "smooth_power" if smooth else "power")
        rates = np.zeros((*power.shape, len(self._in_scene)))
        for column, number in enumerate(self._in_scene):
            if self._names[number] in self._by:
                rates[..., column] = self._taxels(study.sel(parameter=self._names[number]), "derivative")
            else:
                rates[..., column] = self._difference(unknowns, number, study)
        return power, rates

    def _difference(self, unknowns: np.ndarray, number: int, study: xr.Dataset) -> np.ndarray:
        """Derivative (settings, taxels) with respect to an unknown, from the difference to the readings ``study``.

        The step is the smallest one whose change exceeds the noise."""
        unknown, here = self._plan.unknowns[number], self._taxels(study, "replicate_power")
        scale = abs(unknowns[number]) or 1.0
        for tried in range(self._first_step.get(number, 0), len(STEP_SHARES)):
            step = STEP_SHARES[tried] * scale
            if unknowns[number] + step > unknown.high:
                step = max(-step, unknown.low - unknowns[number])
            change = self._taxels(self._read(_shifted(unknowns, number, step), []), "replicate_power") - here
            is_resolved = np.linalg.norm(change.mean(axis=0)) >= RESOLVED * np.linalg.norm(standard_error(change))
            self._first_step[number] = tried
            if is_resolved:
                break
        self.hidden = self.hidden - {unknown.name} if is_resolved else self.hidden | {unknown.name}
        return change.mean(axis=0) / step

    def _read(self, unknowns: np.ndarray, by: Sequence[str]) -> xr.Dataset:
        return self._run(replace(self._batch(unknowns), derivatives=tuple(by)))

    def _run(self, batch: Batch) -> xr.Dataset:
        self.calls += 1
        study = run_batch(batch, self._pool, None)
        if study.attrs["failures"]:
            raise ComputationError(
                f"the scene cannot be read with these values of the unknowns: {study.attrs['failures'].splitlines()[0]}"
            )
        return study

    def _batch(self, unknowns: np.ndarray) -> Batch:
        """The study of all settings with these values of the unknowns."""
        plan = self._plan
        values = {self._names[number]: repr(float(unknowns[number])) for number in self._in_scene}
        together = dict(self._settings)
        if not together:  # a study needs a varied parameter
            name = next(iter(values))
            together = {name: [values.pop(name)]}
        defines = {**plan.defines, **values}
        batch = make_batch(plan.scene, {}, defines, together=together, folder=plan.folder, **plan.reading)
        return replace(batch, bare=True)

    def _taxels(self, study: xr.Dataset, name: str) -> np.ndarray:
        """Values of a variable of a study at the taxels that have data, (..., settings, taxels)."""
        missing = set(self._plan.data.taxels) - set(study.taxel.values)
        if missing:
            raise ComputationError(
                f"the scene has no taxel {min(missing)}, for which there are data: remove them, or add the taxel."
            )
        return study[name].sel(taxel=self._plan.data.taxels).transpose(..., STEP, "taxel").values

    def _shown(self, unknowns: np.ndarray, power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Convert power in W to the unit of the data. Returns the readings and their derivatives with respect to the
        power, both (settings, taxels)."""
        own = dict(zip(self._names, unknowns.tolist(), strict=True))
        if self._plan.circuit is None:
            gain = own.get("gain", 1.0)
            return gain * power + own.get("offset", 0.0), np.full_like(power, gain)
        changes = {name.removeprefix(CIRCUIT): value for name, value in own.items() if name.startswith(CIRCUIT)}
        response = respond(replace(self._plan.circuit, **changes), np.maximum(power, 0.0))
        return response.voltage, response.rate


def _distinct(plan: FitPlan) -> tuple[dict[str, list[str]], np.ndarray]:
    """Distinct settings of the measured data, and the index of the setting of each row."""
    rows = list(zip(*plan.data.settings.values(), strict=True)) or [()] * plan.data.rows
    distinct = list(dict.fromkeys(rows))
    columns = zip(*distinct, strict=True)
    settings = {name: list(words) for name, words in zip(plan.data.settings, columns, strict=True)}
    return settings, np.array([distinct.index(row) for row in rows])


def _shifted(unknowns: np.ndarray, number: int, step: float) -> np.ndarray:
    """A copy of the unknowns with a step added to one of them."""
    shifted = unknowns.copy()
    shifted[number] += step
    return shifted
