"""Derivatives of readings that need random paths, as with mirrors or without a pad: differences of readings of moved
scenes.

Walls of a pad move with the first-order rates of the mechanics, and both ends share their random numbers. Differences
over a step and twice the step are extrapolated (L. F. Richardson, 1911): the correction states what is left of the
step, the scatter of independent randomisations the noise. The step is chosen by pilot runs with other random numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mitsuba_taxel.base import stages
from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.base.differences import AHEAD, BEHIND, CENTRAL, STENCILS
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.kernels.walls import scatters_evenly
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.derivatives.moved_scene import MovedScene, MovingWalls, walls_on
from mitsuba_taxel.sensing.derivatives.package_clearance import clearances
from mitsuba_taxel.sensing.derivatives.scene_rates import Rates
from mitsuba_taxel.sensing.reading.derivative_values import BY_PATHS, Derivatives, unit_of
from mitsuba_taxel.sensing.reading.mechanics_error import restored
from mitsuba_taxel.sensing.reading.runs import FIRST_POINTS, Prepared, derived_seed
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    from mitsuba_taxel.kernels.protocols import PadShape
    from mitsuba_taxel.mechanics.errors.second_state import SecondState

LEVELS, FINER = 4, 2
"""Number of steps that are tried, and how many times each is smaller than the one before, also for extrapolation."""
PILOT = 16
"""Number of the pilot runs' random numbers among those derived from a seed; readings use up to 15."""
NOISE = 0.02
"""Wanted standard error by noise, relative to the root mean square of the derivative over the taxels."""
MORE_POINTS = 2
"""Most points of a derivative, relative to those of the reading."""

Stencil = tuple[tuple[float, float], ...]
Mean = Callable[[np.ndarray], float]
"""Root mean square over the taxels with light of changes (R, T)."""


def derivatives_of_paths(
    changes: list[Rates], ready: Prepared, powers: np.ndarray, seed: int, points: int, fixed: bool
) -> Derivatives:
    """Derivatives of the readings of a prepared scene by the parameters whose :func:`rates` are given.

    Parameters
    ----------
    powers : (R, T) ndarray
        Readings, in W.
    points : int
        Of the readings, per taxel and replicate.
    fixed : bool
        Whether derivatives take as many; else more if they need them, up to `MORE_POINTS` times.

    Raises
    ------
    InputError
        if the scene has no derivative by one of them.
    ComputationError
        if there is no equilibrium nearby.
    """
    pads = deformed_pads(ready.scene)
    with stages.stage("derivatives"), restored(ready.scene, pads):
        effort = _Effort(ready, seed, points, fixed)
        lit = powers.mean(axis=0) > 0
        strain = clearance = math.nan, np.full(len(changes), math.nan)
        if pads:
            pad = _PadAndSecond(pads[0], changes)
            nodal = [pad.linear.nodal(change) for change in changes]
            found = [_AlongWithPad(effort, pad, *each).found(lit) for each in zip(changes, nodal, strict=True)]
            strain = pad.linear.strain(nodal)
            clearance = clearances(pad.linear.state, nodal, ready.scene, [change.scenes() for change in changes])
        else:
            found = [_Along(effort, change).found(lit) for change in changes]
        values, errors = (np.stack(each, axis=1) for each in zip(*found, strict=True))
        return Derivatives(
            tuple(change.name for change in changes),
            tuple(unit_of(change.unit) for change in changes),
            values,
            errors,
            powers.mean(axis=0),
            standard_error(powers),
            *strain,
            *clearance,
            BY_PATHS,
        )


class _Effort(NamedTuple):
    """The readings whose derivatives are wanted, and their random numbers."""

    ready: Prepared
    seed: int
    points: int
    fixed: bool


class _PadAndSecond:
    """The pad of a scene, linearised, and its state on a second mesh."""

    def __init__(self, pad: PadShape, changes: list[Rates]) -> None:
        self.pad = pad
        begins = not pad.is_loaded and any(change.load.any() for change in changes)
        self.linear = LinearisedPad(pad, pad.at_onset() if begins else pad.state)
        self.displaced = pad.is_loaded or begins
        self.second: SecondState | None = pad.second_state() if self.displaced else None
        self.linear_there = None if self.second is None else LinearisedPad(pad, self.second.state)


class _Along:
    """Differences along one parameter of a scene, in which ``walls`` of a pad move if it has one."""

    def __init__(
        self, effort: _Effort, change: Rates, walls: MovingWalls | None = None, stencils: Sequence[Stencil] = STENCILS
    ) -> None:
        self._effort, self._change, self._walls, self._stencils = effort, change, walls, stencils
        self._scene = MovedScene(effort.ready, change)

    def found(self, lit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(T,) derivatives and their errors, with those of the shape averaged over the taxels with light (T,)."""
        chosen = self._chosen()
        read = _Differences(self._scene, chosen.stencil, self._effort.seed, chosen.points)
        near, far = (read.over(times * chosen.step, self._walls) for times in (1, FINER))
        best = (FINER**2 * near - far) / (FINER**2 - 1)
        errors = [standard_error(best), (best - near).mean(axis=0)]

        def mean(changes: np.ndarray) -> float:
            return _root_mean_square(changes[:, lit]) if lit.any() else 0.0

        errors += [error * lit for error in self._of_shape(chosen, read, near, mean)]
        return best.mean(axis=0), np.sqrt(sum(np.square(error) for error in errors))

    def _of_shape(self, chosen: _Chosen, read: _Differences, near: np.ndarray, mean: Mean) -> list[float]:
        """Errors by the shape of a pad."""
        return []

    def _chosen(self) -> _Chosen:
        """Step, stencil and points with the least error, as pilot runs predict it.

        What a step leaves behind shows in its difference from twice the step, or is a quarter of what that leaves if
        noise hides it.
        """
        effort, largest = self._effort, self._scene.largest_step(self._walls) / FINER
        pilot_points = min(FIRST_POINTS, effort.points)
        read, step = self._stencil(largest, derived_seed(effort.seed, PILOT), pilot_points)
        steps = [step / FINER**level for level in range(LEVELS)]
        differences = [read.over(each, self._walls) for each in steps]
        left, last, twice = list[float](), 0.0, read.over(FINER * step, self._walls)
        for each in differences:
            last = max(_root_mean_square(twice - each) / (FINER**2 - 1), last / FINER**2)
            left.append(last)
            twice = each
        noise = [float(np.sqrt((standard_error(each) ** 2).mean())) for each in differences]
        noise = np.maximum.accumulate(noise).tolist()  # rays that begin or cease to hit grow rare, and may be missed
        wanted = NOISE * float(np.sqrt((differences[0].mean(axis=0) ** 2).mean()))

        def points(number: int) -> int:
            if effort.fixed or not wanted:
                return effort.points
            most = MORE_POINTS * effort.points
            return min(max(effort.points, math.ceil(pilot_points * (noise[number] / wanted) ** 2)), most)

        def error(number: int) -> float:
            return math.hypot(noise[number] * math.sqrt(pilot_points / points(number)), left[number])

        best = min(range(LEVELS), key=error)
        return _Chosen(steps[best], read.stencil, points(best))

    def _stencil(self, largest: float, seed: int, points: int) -> tuple[_Differences, float]:
        """Differences by the first stencil of the largest step at which the scene exists, twice as far, too."""
        for level in range(LEVELS):
            for stencil in self._stencils:
                read, step = _Differences(self._scene, stencil, seed, points), largest / FINER**level
                try:
                    read.over(FINER * step, self._walls)
                except (InputError, ComputationError, RuntimeError) as error:  # Mitsuba raises the last for plugins
                    refused = error
                else:
                    return read, step
        raise InputError(
            f"{self._change.name} = {self._change.value:g} has no derivative: it cannot change a little."
        ) from refused


class _AlongWithPad(_Along):
    def __init__(self, effort: _Effort, pad: _PadAndSecond, change: Rates, nodal: Nodal) -> None:
        self._pad, self._mesh = pad, pad.pad.state.mesh
        self._moving = walls_on(self._mesh, pad.linear, nodal)
        has_sides = nodal.side and scatters_evenly(pad.pad.bsdf())
        stencils = (AHEAD if nodal.side > 0 else BEHIND,) if has_sides else STENCILS
        super().__init__(effort, change, self._moving, stencils)

    def _of_shape(self, chosen: _Chosen, read: _Differences, near: np.ndarray, mean: Mean) -> list[float]:
        errors = []
        if self._pad.pad.is_curved:
            chords = MovingWalls(self._moving.displacement, self._moving.nodal, chords=True)
            errors.append(FACETS_SHARE * mean(read.over(chosen.step, chords) - near))
        if self._pad.displaced:
            errors.append(self._of_mechanics(chosen, read, near, mean))
        return errors

    def _of_mechanics(self, chosen: _Chosen, read: _Differences, near: np.ndarray, mean: Mean) -> float:
        """Error by the finite elements, NaN if unknown."""
        second, linear = self._pad.second, self._pad.linear_there
        if second is None or linear is None:
            return math.nan
        other = read.over(chosen.step, walls_on(self._mesh, linear, linear.nodal(self._change)))
        return max(second.share * mean(other - near), second.least * mean(self._through_displacement(chosen, near)))

    def _through_displacement(self, chosen: _Chosen, near: np.ndarray) -> np.ndarray:
        """(R, T), the part of the derivative through the displacement."""
        displacement = self._moving.nodal.displacement
        if not displacement.any():
            return np.zeros_like(near)
        if not (self._change.pad or self._change.beside):
            return near
        scene = MovedScene(self._effort.ready, replace(self._change, beside=[]))
        still = Nodal(displacement, np.zeros_like(displacement), {})
        read = _Differences(scene, CENTRAL, self._effort.seed, chosen.points)
        return read.over(chosen.step, MovingWalls(self._moving.displacement, still))


class _Chosen(NamedTuple):
    step: float
    stencil: Stencil
    points: int


class _Differences:
    """Differences of readings with the same random numbers."""

    def __init__(self, scene: MovedScene, stencil: Stencil, seed: int, points: int) -> None:
        self._scene, self.stencil, self._seed, self._points = scene, stencil, seed, points
        self._known: dict[tuple[float, MovingWalls | None], np.ndarray] = {}

    def over(self, step: float, walls: MovingWalls | None) -> np.ndarray:
        """(R, T) W per unit of the parameter."""
        powers = np.array([self._power(offset * step, walls) for _, offset in self.stencil])
        return np.tensordot([weight / step for weight, _ in self.stencil], powers, axes=1)

    def _power(self, offset: float, walls: MovingWalls | None) -> np.ndarray:
        place = offset, walls
        if place not in self._known:
            self._known[place] = self._scene.power(offset, walls, self._seed, self._points)
        return self._known[place]


def _root_mean_square(changes: np.ndarray) -> float:
    """Of the means over replicates (R, T), over the taxels; what their noise adds on average is left out."""
    squares = changes.mean(axis=0) ** 2 - standard_error(changes) ** 2
    return math.sqrt(max(float(squares.mean()), 0.0))
