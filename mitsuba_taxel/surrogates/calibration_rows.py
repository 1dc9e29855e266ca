"""Rows of readings with the corresponding forces, depths or places, from a study or a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import DISPLACEMENTS, FORCES
from mitsuba_taxel.characterise.recorded.measurement import Measurement
from mitsuba_taxel.characterise.recorded.recorded_runs import runs_of
from mitsuba_taxel.characterise.roles import roles_of_study, with_forces_named
from mitsuba_taxel.electronics.samples import sampled
from mitsuba_taxel.electronics.volts import circuit_of_study

LEAST_SHARE = 0.01
"""A component of a computed force is calibrated if its range, relative to the largest force, is at least this."""
COPIES = 8
"""Number of noisy copies of each reading of a study."""
OVER = {
    "force": (FORCES, "N", "fx, fy or fz"),
    "depth": (DISPLACEMENTS, "mm", "the displacement of a plate or an indenter"),
    "place": (("indenter_x", "indenter_y", "patch_x", "patch_y"), "mm", "the position of an indenter or a patch"),
}
"""Roles of the parameters, unit and description of each kind of quantity."""


class Rows(NamedTuple):
    """Data to which a calibration is fitted: readings (rows, taxels) in W or V; quantities (rows, quantities), such as
    forces; and the number of the path (rows,) to which each row belongs.
    """

    readings: np.ndarray
    quantities: np.ndarray
    path: np.ndarray


class Table(NamedTuple):
    """The data of a calibration with the names and units of quantities and readings."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    unit: str
    rows: Rows


def measured_rows(measurement: Measurement, over: Sequence[str] | None) -> Table:
    """Rows of force and readings from a measurement; each run between turning points of the force is a path.

    Raises
    ------
    InputError
        if a quantity other than the force is requested.
    """
    if over is not None and tuple(over) != ("force",):
        raise InputError(
            f"over = {', '.join(over)} is not allowed for a measurement of forces: over = force alone is needed."
        )
    name, _, force, runs = runs_of(measurement)
    path = np.concatenate([np.full(run.stop - run.start, number) for number, run in enumerate(runs)])
    readings = np.concatenate([measurement.voltage[run] for run in runs])
    return Table((name,), ("N",), "V", Rows(readings, np.concatenate([force[run] for run in runs])[:, None], path))


def simulated_rows(study: xr.Dataset, over: Sequence[str] | None, noise: float, random: np.random.Generator) -> Table:
    """Rows of quantities and noisy readings from a study; each curve is a path.

    Noise of the light and of the circuit, if there is a circuit, is added to the readings. Loads without a reading are
    omitted. If the position of the contact is a quantity, rows without load are omitted, too, as their readings do not
    depend on it.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.
    over : sequence of str, optional
        Requested quantities, keys of `OVER`; by default the force, or the depth if no force is varied, and the position
        of the contact if it is varied.
    noise : float
        Relative standard deviation of the light.
    random : np.random.Generator
        Random numbers of the noise.

    Returns
    -------
    Table

    Raises
    ------
    InputError
        if a requested quantity is not varied.
    """
    study = with_forces_named(study)
    dims = [dim for dim in study.power.dims if dim != "taxel"]
    stacked = study.power.stack(row=dims).transpose("row", "taxel")
    finite = np.isfinite(stacked.values).all(axis=1)
    stacked = stacked[finite]
    roles = roles_of_study(study)
    varied = {kind: _varied(stacked, roles, kind) for kind in OVER}
    if not varied["force"]:
        varied["force"] = _computed_forces(study, dims, finite)
    if over is None:
        load = next((kind for kind in ("force", "depth") if varied[kind]), "force")
        over = [load, *(["place"] if varied["place"] else [])] if varied[load] or not varied["place"] else ["place"]
    for kind in over:
        if not varied[kind]:
            raise InputError(f"no {kind} is varied: a study of several values of {OVER[kind][2]} is needed.")
    columns = {name: (values, OVER[kind][1]) for kind in over for name, values in varied[kind].items()}
    quantities = np.stack([values for values, _ in columns.values()], axis=1)

    # The path of a row is its combination of indices along all dimensions except the curve.
    path_indices = [
        np.unique(stacked[dim].values, return_inverse=True)[1] for dim in dims if dim != study.attrs["curve"]
    ]
    indices = np.stack([np.zeros(stacked.sizes["row"], dtype=int), *path_indices], axis=1)
    path = np.unique(indices, axis=0, return_inverse=True)[1].ravel()
    power = stacked.values
    loads = [
        stacked[name].values
        for name, role in roles.items()
        if role in (*FORCES, *DISPLACEMENTS) and name in stacked.coords and stacked[name].dims == ("row",)
    ]
    if "place" in over and loads:
        loaded = np.any([values != 0 for values in loads], axis=0)
        power, quantities, path = power[loaded], quantities[loaded], path[loaded]

    # Noisy copies of the readings, in W or in V.
    copies = np.tile(power, (COPIES, 1))
    copies = copies * (1 + noise * random.normal(size=copies.shape))
    unit, circuit = "W", circuit_of_study(study)
    if circuit is not None:
        unit, copies = "V", circuit.step * sampled(circuit, copies, random)[1]
    rows = Rows(copies, np.tile(quantities, (COPIES, 1)), np.tile(path, COPIES))
    return Table(tuple(columns), tuple(unit for _, unit in columns.values()), unit, rows)


def _varied(stacked: xr.DataArray, roles: dict[str, str], kind: str) -> dict[str, np.ndarray]:
    """Values (rows,) of the varied parameters of a kind (force, depth or position), by name."""
    wanted = OVER[kind][0]
    named = {role: name for name, role in roles.items()}
    names = [role if role in FORCES else named.get(role, "") for role in wanted]
    columns = {name: stacked[name].values for name in names if name in stacked.coords}
    return {
        name: values.astype(float)
        for name, values in columns.items()
        if values.dtype.kind in "fi" and np.ptp(values) > 0
    }


def _computed_forces(study: xr.Dataset, dims: list, finite: np.ndarray) -> dict[str, np.ndarray]:
    """Forces (rows,) of a plate or an indenter whose displacement is prescribed, where the study contains them.

    Components that change by less than `LEAST_SHARE` of the largest force, or by less than their error, are omitted.
    """
    columns: dict[str, np.ndarray] = {}
    errors: dict[str, np.ndarray] = {}
    for name in FORCES:
        for values_of, suffix in ((columns, ""), (errors, "_error")):
            if f"reaction_{name}{suffix}" in study:
                values = study[f"reaction_{name}{suffix}"].transpose(*dims).values.ravel()[finite]
                values_of[name] = values
    largest = max((float(np.abs(values).max()) for values in columns.values()), default=0.0)
    kept = {}
    for name, values in columns.items():
        known = errors.get(name, np.zeros(1))
        least = max(LEAST_SHARE * largest, float(known[np.isfinite(known)].max(initial=0.0)))
        if np.isfinite(values).all() and np.ptp(values) > least:
            kept[name] = values
    return kept
