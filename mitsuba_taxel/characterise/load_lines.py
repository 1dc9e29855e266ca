"""Straight runs of load in a study, and the experiments that consist of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import FORCES, TIME
from mitsuba_taxel.characterise.experiment import Branch, Experiment, Tangents, parts_at_zero, since
from mitsuba_taxel.characterise.roles import with_forces_named

SAME_DIRECTION = 1e-4
"""One minus the cosine up to which two steps of a path count as parallel: 0.8 degrees, as forces are rounded."""


@dataclass(frozen=True, eq=False)
class LoadLine:
    """A run along which only the force changes, in one direction.

    ``force`` is the component along ``direction``, a unit vector whose first non-zero component is positive; ``name``
    is its name. ``positions`` are those along the dimension ``dim``; ``constant`` has the other values listed along it.
    """

    dim: str
    name: str
    direction: np.ndarray
    positions: np.ndarray
    force: np.ndarray
    constant: dict[str, Any]

    @property
    def ordered(self) -> bool:
        """Whether the load took the forces in this order; forces along their own dimension are independent scenes."""
        return self.dim not in FORCES

    @property
    def loading(self) -> bool:
        """Whether the force's magnitude grows, at least at the end of the line."""
        parts = (np.abs(self.force[part]) for part in parts_at_zero(self.force))
        return not self.ordered or any(part[-1] > part[0] for part in parts)


def load_lines(study: xr.Dataset) -> list[LoadLine]:
    """All runs of load of a study, in the order of its dimensions and of the load.

    A dimension ``fx``, ``fy`` or ``fz`` of at least two values is one run, from the smaller force to the larger. A
    dimension along which forces are listed is split wherever the force turns, is constant or another parameter changes;
    runs of two points are left out unless there are no longer ones, as any two points lie on a line.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene, with components of the force called ``fx``, ``fy`` and ``fz``.

    Returns
    -------
    list[LoadLine]
        Empty if no force is varied.
    """
    lines: list[LoadLine] = []
    for dim in map(str, study.replicate_power.dims):
        listed = [name for name in FORCES if name in study.coords and study[name].dims == (dim,)]
        if dim in FORCES and study.sizes[dim] > 1:
            lines.append(_set_line(study, dim))
        elif dim not in FORCES and listed and study.sizes[dim] > 1:
            lines.extend(_path_lines(study, dim, listed))
    return lines


def loading_lines(study: xr.Dataset) -> list[LoadLine]:
    """The lines of growing force; for a path back and forth along a line, the first run."""
    first: dict[tuple, LoadLine] = {}
    for line in load_lines(study):
        if line.loading:
            first.setdefault((line.dim, line.name, *line.constant.items()), line)
    return list(first.values())


def runs(study: xr.Dataset, line: LoadLine) -> Iterator[tuple[dict[str, Any], Branch]]:
    """For each combination of the other varied parameters: their values, and the readings in W along the line.

    Points without a reading are left out.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.
    line : LoadLine
        One of :func:`load_lines`.

    Yields
    ------
    where : dict[str, Any]
        Values of the other parameters by name.
    run : Branch
        Forces in N and readings in W.
    """
    power = study.replicate_power.isel({line.dim: line.positions})
    others = [dim for dim in power.dims if dim not in (line.dim, "replicate", "taxel")]
    power = power.transpose(*others, line.dim, "replicate", "taxel")
    tangents = _tangents(study, line, others)
    for index in np.ndindex(power.shape[: len(others)]):
        where = {str(dim): _plain(study, dim, number) for dim, number in zip(others, index, strict=True)}
        samples = power.values[index]
        there = np.isfinite(samples).all(axis=(1, 2))
        along = None if tangents is None else tangents.part(index).part(there)
        known = along is not None and np.isfinite(along.slope).all()
        yield where, Branch(line.force[there], samples[there], along if known else None)


def _tangents(study: xr.Dataset, line: LoadLine, others: list[Any]) -> Tangents | None:
    """Slopes along a line (others, points, taxels), None without derivatives with respect to all of its forces."""
    parts = {name: share for name, share in zip(FORCES, line.direction.tolist(), strict=True) if share}
    if "derivative" not in study or not set(parts) <= set(study.parameter.values.tolist()):
        return None
    shares = xr.DataArray(list(parts.values()), dims="parameter", coords={"parameter": list(parts)})
    by_force = study[["derivative", "derivative_error"]].sel(parameter=list(parts))
    # Errors of the components are taken as fully correlated, as they come from the same elements.
    slope = (by_force.derivative * shares).sum("parameter", skipna=False)
    error = (by_force.derivative_error * abs(shares)).sum("parameter", skipna=False)
    order = [*others, line.dim, "taxel"]
    return Tangents(
        *(each.isel({line.dim: line.positions}).transpose(*order).values for each in (study.smooth_power, slope, error))
    )


def experiments(study: xr.Dataset | xr.DataTree) -> list[Experiment]:
    """Every line of load of a study, one experiment for each combination of the other varied parameters.

    Experiments of several scenes are distinguished by ``scene``.

    Runs of a path back and forth along one line are one experiment. Runs without any reading are left out. Changes are
    relative to the first of the points of least force.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        As returned by ``open_study``.

    Returns
    -------
    list[Experiment]
        With readings in W.
    """
    if isinstance(study, xr.DataTree):
        return [
            experiment.labelled(scene=leaf.name)
            for leaf in study.leaves
            for experiment in experiments(leaf.to_dataset())
        ]
    study = with_forces_named(study)
    found: dict[tuple, tuple[LoadLine, dict[str, Any], list[Branch]]] = {}
    for line in load_lines(study):
        for where, run in runs(study, line):
            where = {**where, **line.constant}
            _, _, together = found.setdefault((line.dim, line.name, *where.items()), (line, where, []))
            together.append(run)
    return [
        _experiment(line, where, together, study.taxel.values, unit_of(study))
        for line, where, together in found.values()
        if any(len(run.force) for run in together)
    ]


def unit_of(study: xr.Dataset) -> str:
    """Unit of its readings: ``W``, or ``V`` behind a circuit."""
    return study.replicate_power.attrs.get("units", "W")


def _experiment(
    line: LoadLine, where: dict[str, Any], together: list[Branch], taxel: np.ndarray, unit: str
) -> Experiment:
    """Changes since the readings at the least force."""
    force = np.concatenate([run.force for run in together])
    rest = np.concatenate([run.samples for run in together])[np.abs(force).argmin()]
    return Experiment(line.name, line.direction, where, unit, taxel, since(rest, together), line.ordered, rest)


def _set_line(study: xr.Dataset, dim: str) -> LoadLine:
    positions = np.argsort(study[dim].values)
    force = study[dim].values[positions]
    outward = slice(None, None, -1 if abs(force[0]) > abs(force[-1]) else 1)
    direction = np.array([float(name == dim) for name in FORCES])
    return LoadLine(dim, dim, direction, positions[outward], force[outward], {})


def _path_lines(study: xr.Dataset, dim: str, listed: list[str]) -> Iterator[LoadLine]:
    forces = np.zeros((study.sizes[dim], len(FORCES)))
    for name in listed:
        forces[:, FORCES.index(name)] = study[name].values
    beside = {
        str(name): coordinate.values
        for name, coordinate in study.coords.items()
        if coordinate.dims == (dim,) and name not in (dim, TIME)
    }
    steps = np.diff(forces, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    moves = lengths > 0
    for name, values in beside.items():
        if name not in FORCES:
            moves &= values[1:] == values[:-1]
    units = steps / np.where(lengths > 0, lengths, 1)[:, None]

    def parallel(one: int, other: int) -> bool:
        return bool(units[one] @ units[other] > 1 - SAME_DIRECTION)

    first = 0
    while first < len(steps):
        last = first
        while last + 1 < len(steps) and moves[first] and moves[last + 1] and parallel(first, last + 1):
            last += 1
        positions = np.arange(first, last + 2)
        if moves[first] and (len(positions) > 2 or len(steps) == 1):
            yield _line(dim, positions, forces[positions], beside)
        first = last + 1


def _line(dim: str, positions: np.ndarray, forces: np.ndarray, beside: dict[str, np.ndarray]) -> LoadLine:
    direction = forces[-1] - forces[0]
    direction = direction / np.linalg.norm(direction)
    direction[np.abs(direction) < np.sqrt(2 * SAME_DIRECTION)] = 0
    direction *= np.sign(direction[np.flatnonzero(direction)[0]]) / np.linalg.norm(direction)
    constant = {
        name: values[positions[0]].item() if isinstance(values[positions[0]], np.generic) else values[positions[0]]
        for name, values in beside.items()
        if name not in FORCES or direction[FORCES.index(name)] == 0
    }
    return LoadLine(dim, force_name(direction), direction, positions, forces @ direction, constant)


def force_name(direction: np.ndarray) -> str:
    """``fz`` or, for a force in several components, its component along ``direction``: ``0.6 fx + 0.8 fz``."""
    parts = [(number, name) for number, name in zip(direction, FORCES, strict=True) if number]
    if len(parts) == 1:
        return parts[0][1]
    words = [f"{'-' if number < 0 else '+'} {abs(number):.3g} {name}" for number, name in parts]
    return " ".join(words).removeprefix("+ ")


def _plain(study: xr.Dataset, dim: Any, number: int) -> Any:
    return study[dim].values[number].item() if dim in study.coords else number
