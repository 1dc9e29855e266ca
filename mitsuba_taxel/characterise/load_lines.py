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
from mitsuba_taxel.sensing.reading.derivative_values import BY_CURVE, DETERMINISTIC

SAME_DIRECTION = 1e-4
"""One minus the cosine up to which two steps of a path count as parallel: 0.8 degrees, as forces are rounded."""


@dataclass(frozen=True, eq=False)
class LoadLine:
    """A run in which only the force changes, in one direction.

    ``direction`` is a unit vector whose first non-zero component is positive; ``force`` (points,) is the component
    along it in N, and ``name`` the name of that component. ``positions`` (points,) are indices along the dimension
    ``dim`` of the study. ``constant`` holds the values of the other parameters that are listed along ``dim``.
    """

    dim: str
    name: str
    direction: np.ndarray
    positions: np.ndarray
    force: np.ndarray
    constant: dict[str, Any]

    @property
    def ordered(self) -> bool:
        """Whether the load passed through the forces of the line in their order. It did not if the force is a dimension
        of the study: the forces then belong to independent scenes.
        """
        return self.dim not in FORCES

    @property
    def loading(self) -> bool:
        """Whether the force's magnitude grows, at least at the end of the line."""
        magnitudes = (np.abs(self.force[points]) for points in parts_at_zero(self.force))
        return not self.ordered or any(magnitude[-1] > magnitude[0] for magnitude in magnitudes)


def load_lines(study: xr.Dataset) -> list[LoadLine]:
    """All runs of load (sequences of scenes in which only the force changes, in one direction) of a study, in the order
    of its dimensions and of the load.

    A dimension ``fx``, ``fy`` or ``fz`` of at least two values is one run, from the smaller force to the larger. A
    dimension along which forces are listed is split wherever the force turns, is constant or another parameter changes.
    Runs of two points are left out unless the study has no other points, as any two points lie on a line.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene, with components of the force called ``fx``, ``fy`` and ``fz``.

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
    """Lines of load in which the magnitude of the force grows; for each direction of the force, the first such line.

    A path that loads and unloads several times along one direction thus gives its first loading run only.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene, with components of the force called ``fx``, ``fy`` and ``fz``.

    Returns
    -------
    list[LoadLine]
        Empty if no force is varied.
    """
    first: dict[tuple, LoadLine] = {}
    for line in load_lines(study):
        if line.loading:
            first.setdefault((line.dim, line.name, *line.constant.items()), line)
    return list(first.values())


def runs(study: xr.Dataset, line: LoadLine) -> Iterator[tuple[dict[str, Any], Branch]]:
    """The readings along a line of load, for each combination of the other varied parameters.

    Points without a reading are left out.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.
    line : LoadLine
        A line of :func:`load_lines`.

    Yields
    ------
    where : dict[str, Any]
        Values of the other varied parameters by name.
    run : Branch
        Forces in N and readings in the unit of the study, along the line.
    """
    power = study.variables["replicate_power"].isel({line.dim: line.positions})
    other_dims = [dim for dim in power.dims if dim not in (line.dim, "replicate", "taxel")]
    power = power.transpose(*other_dims, line.dim, "replicate", "taxel")
    tangents, methods = _tangents(study, line, other_dims), _methods(study, line, other_dims)
    at = {dim: study[dim].values for dim in other_dims if dim in study.coords}
    for index in np.ndindex(power.shape[: len(other_dims)]):
        where = {
            str(dim): at[dim][number].item() if dim in at else number
            for dim, number in zip(other_dims, index, strict=True)
        }
        samples = power.values[index]
        finite = np.isfinite(samples).all(axis=(1, 2))
        tangent = None if tangents is None else tangents.part(index).part(finite)
        usable = tangent is not None and np.isfinite(tangent.slope).all()
        method = set() if methods is None else set(methods[index].ravel())
        yield (
            where,
            Branch(
                line.force[finite],
                samples[finite],
                tangent if usable and method <= {DETERMINISTIC, ""} else None,
                is_fitted=BY_CURVE in method,
            ),
        )


def _methods(study: xr.Dataset, line: LoadLine, other_dims: list[Any]) -> np.ndarray | None:
    """Methods of the derivatives along a line (other dimensions, points, components); None without derivatives."""
    names = [name for name, component in zip(FORCES, line.direction, strict=True) if component]
    if "derivative_method" not in study or not set(names) <= set(study.parameter.values.tolist()):
        return None
    parameters = [study.parameter.values.tolist().index(name) for name in names]
    methods = study.variables["derivative_method"].isel({"parameter": parameters, line.dim: line.positions})
    return methods.transpose(*other_dims, line.dim, "parameter").values


def _tangents(study: xr.Dataset, line: LoadLine, other_dims: list[Any]) -> Tangents | None:
    """Slopes along a line (other dimensions, points, taxels); None if a derivative with respect to one of its forces is
    missing."""
    components = {name: component for name, component in zip(FORCES, line.direction.tolist(), strict=True) if component}
    if "derivative" not in study or not set(components) <= set(study.parameter.values.tolist()):
        return None
    parameters = [study.parameter.values.tolist().index(name) for name in components]
    weights = xr.Variable("parameter", list(components.values()))
    derivative, derivative_error = (
        study.variables[name].isel(parameter=parameters) for name in ("derivative", "derivative_error")
    )
    # The errors of the components count as fully correlated, as they come from the same finite elements.
    slope = (derivative * weights).sum("parameter", skipna=False)
    error = (derivative_error * abs(weights)).sum("parameter", skipna=False)
    order = [*other_dims, line.dim, "taxel"]
    return Tangents(
        *(
            array.isel({line.dim: line.positions}).transpose(*order).values
            for array in (study.variables["smooth_power"], slope, error)
        )
    )


def experiments(study: xr.Dataset | xr.DataTree) -> list[Experiment]:
    """Experiments of a study: one for each line of load and each combination of the other varied parameters.

    Experiments of several scenes are distinguished by ``scene``. The runs of a path up and down along one line form one
    experiment. Runs without any reading are left out. Changes are relative to the point of least force, or the first of
    several such points.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``open_study``.

    Returns
    -------
    list[Experiment]
        Experiments with readings in W.
    """
    if isinstance(study, xr.DataTree):
        return [
            experiment.labelled(scene=leaf.name)
            for leaf in study.leaves
            for experiment in experiments(leaf.to_dataset())
        ]
    study = with_forces_named(study)
    groups: dict[tuple, tuple[LoadLine, dict[str, Any], list[Branch]]] = {}
    for line in load_lines(study):
        for where, run in runs(study, line):
            where = {**where, **line.constant}
            _, _, line_runs = groups.setdefault((line.dim, line.name, *where.items()), (line, where, []))
            line_runs.append(run)
    return [
        _experiment(line, where, line_runs, study.taxel.values, unit_of(study))
        for line, where, line_runs in groups.values()
        if any(len(run.force) for run in line_runs)
    ]


def unit_of(study: xr.Dataset) -> str:
    """Unit of a study's readings: ``W``, or ``V`` behind a circuit."""
    return study.replicate_power.attrs.get("units", "W")


def _experiment(
    line: LoadLine, where: dict[str, Any], line_runs: list[Branch], taxel: np.ndarray, unit: str
) -> Experiment:
    """Create an experiment from runs. Its changes are relative to the readings at the least force."""
    force = np.concatenate([run.force for run in line_runs])
    rest = np.concatenate([run.samples for run in line_runs])[np.abs(force).argmin()]
    return Experiment(
        force=line.name,
        direction=line.direction,
        where=where,
        unit=unit,
        taxel=taxel,
        runs=since(rest, line_runs),
        ordered=line.ordered,
        rest=rest,
    )


def _set_line(study: xr.Dataset, dim: str) -> LoadLine:
    """The line of load along a force that is a dimension of the study, from the smaller magnitude to the larger."""
    positions = np.argsort(study[dim].values)
    force = study[dim].values[positions]
    outward = slice(None, None, -1 if abs(force[0]) > abs(force[-1]) else 1)
    direction = np.array([float(name == dim) for name in FORCES])
    return LoadLine(dim, dim, direction, positions[outward], force[outward], {})


def _path_lines(study: xr.Dataset, dim: str, listed: list[str]) -> Iterator[LoadLine]:
    """The straight runs of a path whose forces ``listed`` change along the dimension ``dim``."""
    # Forces (points, 3) along the path, and the other parameters listed along it.
    forces = np.zeros((study.sizes[dim], len(FORCES)))
    for name in listed:
        forces[:, FORCES.index(name)] = study[name].values
    coordinates = {
        str(name): coordinate.values
        for name, coordinate in study.coords.items()
        if coordinate.dims == (dim,) and name not in (dim, TIME)
    }

    # Steps in which the force changes while every other parameter is constant.
    steps = np.diff(forces, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    changes = lengths > 0
    for name, values in coordinates.items():
        if name not in FORCES:
            changes &= values[1:] == values[:-1]
    units = steps / np.where(lengths > 0, lengths, 1)[:, None]

    def parallel(first: int, second: int) -> bool:
        return bool(units[first] @ units[second] > 1 - SAME_DIRECTION)

    # A run is as many parallel steps in sequence as possible.
    first = 0
    while first < len(steps):
        last = first
        while last + 1 < len(steps) and changes[first] and changes[last + 1] and parallel(first, last + 1):
            last += 1
        positions = np.arange(first, last + 2)
        if changes[first] and (len(positions) > 2 or len(steps) == 1):
            yield _line(dim, positions, forces[positions], coordinates)
        first = last + 1


def _line(dim: str, positions: np.ndarray, forces: np.ndarray, coordinates: dict[str, np.ndarray]) -> LoadLine:
    """The line of load through ``forces`` (points, 3) in N. Rounding errors are removed from its direction."""
    direction = forces[-1] - forces[0]
    direction = direction / np.linalg.norm(direction)
    direction[np.abs(direction) < np.sqrt(2 * SAME_DIRECTION)] = 0
    direction *= np.sign(direction[np.flatnonzero(direction)[0]]) / np.linalg.norm(direction)
    constant = {
        name: values[positions[0]].item() if isinstance(values[positions[0]], np.generic) else values[positions[0]]
        for name, values in coordinates.items()
        if name not in FORCES or direction[FORCES.index(name)] == 0
    }
    return LoadLine(dim, force_name(direction), direction, positions, forces @ direction, constant)


def force_name(direction: np.ndarray) -> str:
    """``fz`` or, for a force in several components, its component along ``direction``: ``0.6 fx + 0.8 fz``."""
    components = [(number, name) for number, name in zip(direction, FORCES, strict=True) if number]
    if len(components) == 1:
        return components[0][1]
    words = [f"{'-' if number < 0 else '+'} {abs(number):.3g} {name}" for number, name in components]
    return " ".join(words).removeprefix("+ ")
