"""Derivatives of readings by parameters of a scene: force, material, dimensions, parts.

Light in diffuse cells is computed without random numbers, so that derivatives are as accurate as readings (see
`transport`). A parameter moves the walls of the cells through the mechanics, and changes LED, phototransistor and the
scattering of walls: dP = dP/dx . dx + dP/d(ends).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_taxel.base import stages
from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.threads import thread_count
from mitsuba_taxel.sensing.derivative_values import Derivatives
from mitsuba_taxel.sensing.deterministic_light import COARSE, FINE, MOST_HIDDEN, reading_error
from mitsuba_taxel.sensing.diffuse_cells import DiffuseCells, NotDiffuse
from mitsuba_taxel.sensing.equal_cells import equal_cells
from mitsuba_taxel.sensing.scene_rates import Rates
from mitsuba_taxel.transport.cell import Cell

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import LinearisedState
    from mitsuba_taxel.mechanics.results.largest_strain import LargestStrain
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

LIGHT_SHARE = 0.25
"""Standard deviation of the derivatives of the finer solution, relative to their difference from the coarser one's."""
HORIZON_SHARE = 1.3
"""Standard deviation of a derivative, relative to its change with a horizon of twice the width: compared with
differences of readings of bent plates and loaded pads, it is 0.5 to 2.5."""
SMALL = 1e-4
"""Displacement, relative to the pad's size, of the state for the error of rates of a pad at rest."""
TINY = np.finfo(float).tiny
PARALLEL = 1e-8
"""One minus the cosine up to which two changes of a load count as parallel."""


def derivatives_by(changes: list[Rates], live: Any, with_errors: bool = True, degree: int = FINE) -> Derivatives:
    """Derivatives of the readings of a loaded scene by the parameters whose :func:`rates` are given.

    Parameters
    ----------
    with_errors : bool
        Whether to compute errors, which take most of the time; else they are NaN.
    degree : int
        Of the solutions on a patch; degree 1, available without errors, is accurate to a percent in half the time.

    Raises
    ------
    InputError
        if the scene has no derivative by one of them; `NotDiffuse` if its light needs random paths, as with mirrors.
    ComputationError
        if there is no equilibrium nearby, or too much light is occluded.
    """
    try:
        with stages.stage("derivatives"):
            return _Linearised(DiffuseCells(live), with_errors, degree).by(changes)
    except NotDiffuse as reason:
        raise NotDiffuse(f"derivatives are not available: {reason}.") from reason


class _Linearised:
    """A scene of diffuse cells, and the derivatives of its readings by the positions of its walls."""

    def __init__(self, cells: DiffuseCells, with_errors: bool, degree: int) -> None:
        self.cells, self.with_errors, self.degree = cells, with_errors, degree
        self.state = cells.pad.state
        self.patches = [cells.patches(number) for number in range(len(cells.cells))]

    @cached_property
    def _linear(self) -> LinearisedState:
        from mitsuba_taxel.mechanics import linearise

        return linearise(self.state)

    @cached_property
    def _strain(self) -> LargestStrain:
        from mitsuba_taxel.mechanics.results.largest_strain import LargestStrain

        return LargestStrain(self.state)

    def by(self, changes: list[Rates]) -> Derivatives:
        nodal = [self._nodal(change) for change in changes]
        others = [[(weight, DiffuseCells(live)) for weight, live in change.scenes] for change in changes]
        # Many small matrix products: each would start and wait for its own threads.
        first = self._equal(nodal, others)
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(thread_count()) as pool:
            alone = sorted(set(first))
            found = pool.map(lambda number: _OfCell(self, number, nodal, others).found(), alone)
            by_number = dict(zip(alone, found, strict=True))
        solved = [by_number[number] for number in first]
        power = np.array([taxel.power for taxel in self.cells.taxels])[:, None]
        shares = {number: self.cells.hidden_share(*each.flows) for number, each in by_number.items()}
        hidden = np.array([shares[number] for number in first])[:, None]
        reading = np.array([each.reading for each in solved])[:, None]
        if hidden.max() > MOST_HIDDEN:
            raise ComputationError(
                f"derivatives are not available: {hidden.max():.1%} of a reading comes by ways that walls stand in."
            )
        scale = np.array([_scale(change, self.cells.pad.value) for change in changes])
        blocked = 2 * hidden * reading / np.where(scale > 0, scale, np.inf)
        errors = np.array([each.errors for each in solved])
        return Derivatives(
            tuple(change.name for change in changes),
            tuple("W" if change.unit == "1" else f"W/{change.unit}" for change in changes),
            power * np.array([each.values for each in solved]),
            power * np.hypot(errors, blocked),
            (power * reading)[:, 0],
            (power * np.hypot(np.array([[each.reading_error] for each in solved]), hidden * reading))[:, 0],
            self._strain.value,
            np.array([each.strain for each in nodal]),
        )

    def _equal(self, nodal: list[_Nodal], others: list) -> list[int]:
        """The representative cell of each cell."""
        if any(others):
            return list(range(len(self.patches)))
        fields = [self.state.displacement, *(each.displacement for each in nodal)]
        errors = [part for each in nodal if each.deviations is not None for part in each.deviations]
        if self.with_errors and self.state.deviations is not None:
            errors += [*self.state.deviations]
        return equal_cells(self.cells, fields, errors)

    def _nodal(self, change: Rates) -> _Nodal:
        from mitsuba_taxel.pads.parametric.velocities import mesh_velocity

        pad, displacement = self.cells.pad, np.zeros_like(self.state.displacement)
        velocity = np.zeros_like(displacement)
        if change.load.any():
            displacement += self._by_load(change.load)
        if not pad.is_loaded:  # only a load displaces a pad at rest
            deviations = self._deviations_at_rest(change.load, displacement)
            return _Nodal(displacement, change.pad, deviations, self._strain.rate(displacement, velocity))
        if change.place.any():
            displacement += self._linear.by_place(change.place)
        softer = np.zeros_like(displacement)
        for name, rate in change.material.items():
            softer += rate * self._linear.by_material(name)
        displacement += softer
        for name, rate in change.pad.items():
            velocity += rate * mesh_velocity(replace(pad.pad), self.state.mesh, name)
        if change.pad:
            displacement += self._linear.by_shape(velocity)
        deviations = self._deviations_along(displacement, change.load, softer)
        return _Nodal(displacement, change.pad, deviations, self._strain.rate(displacement, velocity))

    def _by_load(self, load: np.ndarray) -> np.ndarray:
        """(N, 3) first-order displacement for a change of the load; along the path it is already known."""
        ahead = self.state.path_rate()
        if ahead is not None and abs(load @ ahead.direction) > (1 - PARALLEL) * np.linalg.norm(load):
            return (load @ ahead.direction) * ahead.displacement
        return self._linear.by_value(load)

    def _deviations_along(self, rate: np.ndarray, load: np.ndarray, softer: np.ndarray) -> np.ndarray | None:
        """(2, N, 3) change of a rate with coarser elements: the relative change along the displacement, and the
        remainder, to the extent that the load change is parallel to the load, or the effect of the material to the
        displacement."""
        if not self.with_errors or self.state.deviations is None:
            return None
        along, rest = self.state.deviations
        value, displacement = np.array(self.cells.pad.value), self.state.displacement
        walls = np.any(along != 0, axis=1)
        share = np.vdot(along[walls], displacement[walls]) / max(
            np.vdot(displacement[walls], displacement[walls]), TINY
        )
        squared = max(np.vdot(displacement, displacement), TINY)
        alike = (load @ value) / (value @ value) + np.vdot(softer, displacement) / squared
        return np.stack([share * rate, alike * rest])

    def _deviations_at_rest(self, load: np.ndarray, rate: np.ndarray) -> np.ndarray | None:
        """(2, N, 3) the same, from a state under a small load."""
        if not load.any():
            return np.zeros((1, *rate.shape))
        if not self.with_errors:
            return None
        size = SMALL * np.ptp(self.state.mesh.points) / np.abs(rate).max()
        state = self.cells.pad.state_under(size * load)
        return None if state.deviations is None else state.deviations / size


@dataclass(frozen=True, eq=False)
class _Nodal:
    """Rates of the nodes with a parameter.

    Attributes
    ----------
    displacement : (N, 3) ndarray
        Rate of their displacement, in mm.
    dimensions : dict[str, float]
        Rates of the dimensions of the pad.
    deviations : (K, N, 3) ndarray or None
        Change of the first with coarser finite elements.
    strain : float
        Rate of the largest strain.
    """

    displacement: np.ndarray
    dimensions: dict[str, float]
    deviations: np.ndarray | None
    strain: float


class _Found(NamedTuple):
    """Results of a cell: its reading per W of its LED, the derivatives by each change, and its light paths."""

    reading: float
    reading_error: float
    values: np.ndarray
    errors: np.ndarray
    flows: tuple[np.ndarray, np.ndarray, np.ndarray]


class _OfCell:
    """One cell, and the rates of its walls."""

    def __init__(self, whole: _Linearised, number: int, nodal: list[_Nodal], others: list) -> None:
        self._whole, self._number = whole, number
        self._patches: WallPatches = whole.patches[number]
        self._rest = self._patches.rest
        self._at = self._rest + self._patches.carried(whole.state.displacement)
        self._nodal = nodal
        self._velocities = [self._velocity(each) for each in nodal]
        self._others = others

    def found(self) -> _Found:
        """Results of the cell, without its pairs of points, which take much memory."""
        fine = self._solved(self._whole.degree, self._at)
        values = self._derivatives(fine, fine.gradient())
        unknown = np.full_like(values, np.nan), np.nan
        errors, of_reading = self._errors(values, fine.reading) if self._whole.with_errors else unknown
        return _Found(fine.reading, of_reading, values, errors, fine.flows())

    def _errors(self, values: np.ndarray, reading: float) -> tuple[np.ndarray, float]:
        """Errors of derivatives, and of the reading."""
        cell = self._solved(COARSE, self._at)
        gradient = cell.gradient()
        coarse = self._derivatives(cell, gradient)
        spread = self._derivatives(cell, cell.gradient(wider=2)) - coarse
        light = np.hypot(LIGHT_SHARE * (values - coarse), HORIZON_SHARE * spread)
        mechanics, of_reading = self._mechanics(gradient, coarse, cell.reading)
        of_light = reading_error(reading, cell.reading)
        return np.hypot(light, ERROR_SHARE * mechanics), math.hypot(of_light, ERROR_SHARE * of_reading)

    def _solved(self, degree: int, places: np.ndarray) -> Cell:
        cells = self._whole.cells
        return cells.solved(self._number, cells.light_mesh(self._number, degree), places)

    def _velocity(self, nodal: _Nodal) -> np.ndarray:
        """(F, 15, 3) velocity of the deformed walls."""
        displacement = self._whole.state.displacement
        dimensions = (rate * self._patches.moved(name, displacement) for name, rate in nodal.dimensions.items())
        return sum(dimensions, start=self._patches.carried(nodal.displacement))

    def _derivatives(self, cell: Cell, gradient: np.ndarray) -> np.ndarray:
        by_walls = [float((gradient * velocity).sum()) for velocity in self._velocities]
        return np.array(by_walls) + [self._by_parts(cell, scenes) for scenes in self._others]

    def _by_parts(self, cell: Cell, scenes: list[tuple[float, DiffuseCells]]) -> float:
        own, taxel = self._whole.cells.cells[self._number], self._whole.cells.taxels[self._number]
        total = 0.0
        for weight, other in scenes:
            there, then = other.cells[self._number], other.taxels[self._number]
            scattered = (there.isotropic + there.lambertian) / (own.isotropic + own.lambertian)
            change = cell.change(then.led, then.phototransistor, then.body, scattered)
            total += weight * (change + cell.reading * then.power / taxel.power)
        return total

    def _mechanics(self, gradient: np.ndarray, derivatives: np.ndarray, reading: float) -> tuple[np.ndarray, float]:
        """Changes of derivatives and reading with coarser finite elements, through rates and positions of walls."""
        state = self._whole.state
        of_rates = [each.deviations for each in self._nodal if each.deviations is not None]
        if state.deviations is None or len(of_rates) < len(self._nodal):
            return np.full_like(derivatives, np.nan), math.nan
        rates = [[(gradient * self._patches.carried(part)).sum() for part in each] for each in of_rates]
        squares, of_reading = np.array([np.square(each).sum() for each in rates]), 0.0
        for deviation in state.deviations if any(self._whole.cells.pad.value) else ():
            there = self._solved(COARSE, self._at + self._patches.carried(deviation))
            squares += (self._derivatives(there, there.gradient()) - derivatives) ** 2
            of_reading += (there.reading - reading) ** 2
        return np.sqrt(squares), math.sqrt(of_reading)


def _scale(change: Rates, load: Sequence[float]) -> float:
    """Scale of a parameter: its value, or that of the load of which it is a component."""
    return float(np.linalg.norm(load)) if change.load.any() else abs(change.value)
