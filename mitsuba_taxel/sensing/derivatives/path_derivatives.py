"""Derivatives of readings by random paths, for scenes with mirrors or without a pad: differences of readings at
neighbouring values of the parameter.

The walls of a pad move with the first-order rates of the mechanics, and the readings of a difference share their random
numbers. Differences over a step and over twice the step are extrapolated to a step of 0 (L. F. Richardson, 1911). The
change by the extrapolation is stated as the error due to the step; the scatter of independent randomisations gives the
error due to noise. Pilot runs with other random numbers choose the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.base.differences import AHEAD, BEHIND, CENTRAL, STENCILS
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes import stages
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
"""Number of steps that are tried, and the ratio of successive steps, which is also that of the extrapolation."""
PILOT = 16
"""Index of the seed of pilot runs, for `derived_seed`; readings use indices up to 15."""
NOISE = 0.02
"""Target for the standard error due to noise, relative to the root mean square of the derivative over the taxels."""
MORE_POINTS = 2
"""Largest number of points of a derivative, relative to that of the reading."""

Stencil = tuple[tuple[float, float], ...]
Mean = Callable[[np.ndarray], float]
"""Function that returns the root mean square of changes (R, T) over the taxels that receive light."""


def derivatives_of_paths(
    changes: list[Rates], ready: Prepared, powers: np.ndarray, seed: int, points: int, fixed: bool
) -> Derivatives:
    """Compute the derivatives of the readings of a prepared scene with respect to parameters, by differences of random
    paths.

    Parameters
    ----------
    changes : list[Rates]
        Rates of the scene's parts with each parameter, from :func:`rates`.
    ready : Prepared
        The scene.
    powers : (R, T) ndarray
        Readings of T taxels in R replicates, in W.
    seed : int
        Seed of the readings.
    points : int
        Number of points of the readings, per taxel and replicate.
    fixed : bool
        Whether the derivatives use the same number of points. If not, they use up to `MORE_POINTS` times as many, until
        their noise is small.

    Returns
    -------
    Derivatives
        Derivatives in W per unit of each parameter.

    Raises
    ------
    InputError
        if the readings have no derivative with respect to one of the parameters.
    ComputationError
        if the pad has no equilibrium at a neighbouring load.
    """
    pads = deformed_pads(ready.scene)
    with stages.stage("derivatives"), restored(ready.scene, pads):
        effort = _Effort(ready, seed, points, fixed)
        lit = powers.mean(axis=0) > 0
        strain = clearance = math.nan, np.full(len(changes), math.nan)
        if pads:
            pad = _PadAndSecond(pads[0], changes)
            nodal = [pad.linear.nodal(change) for change in changes]
            estimates = [
                _AlongWithPad(effort, pad, *change).estimate(lit) for change in zip(changes, nodal, strict=True)
            ]
            strain = pad.linear.strain(nodal)
            clearance = clearances(pad.linear.state, nodal, ready.scene, [change.scenes() for change in changes])
        else:
            estimates = [_Along(effort, change).estimate(lit) for change in changes]
        values, errors = (np.stack(columns, axis=1) for columns in zip(*estimates, strict=True))
        return Derivatives(
            parameters=tuple(change.name for change in changes),
            units=tuple(unit_of(change.unit) for change in changes),
            values=values,
            standard_errors=errors,
            power=powers.mean(axis=0),
            power_errors=standard_error(powers),
            strain=strain[0],
            strain_rates=strain[1],
            clearance=clearance[0],
            clearance_rates=clearance[1],
            method=BY_PATHS,
        )


class _Effort(NamedTuple):
    """The prepared scene to be differentiated, with the seed and the number of points of its readings."""

    ready: Prepared
    seed: int
    points: int
    fixed: bool


class _PadAndSecond:
    """The linearised pad of a scene, and the same pad linearised on a second mesh."""

    def __init__(self, pad: PadShape, changes: list[Rates]) -> None:
        self.pad = pad
        at_onset = not pad.is_loaded and any(change.load.any() for change in changes)
        self.linear = LinearisedPad(pad, pad.at_onset() if at_onset else pad.state)
        self.displaced = pad.is_loaded or at_onset
        self.second: SecondState | None = pad.second_state() if self.displaced else None
        self.second_linear = None if self.second is None else LinearisedPad(pad, self.second.state)


class _Along:
    """Differences of readings when one parameter of a scene changes. ``walls`` are the moving walls of the pad, if the
    scene has a pad.
    """

    def __init__(
        self, effort: _Effort, change: Rates, walls: MovingWalls | None = None, stencils: Sequence[Stencil] = STENCILS
    ) -> None:
        self._effort, self._change, self._walls, self._stencils = effort, change, walls, stencils
        self._scene = MovedScene(effort.ready, change)

    def estimate(self, lit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the readings with respect to one parameter: values (T,) of T taxels in W per unit of the
        parameter, and their errors (T,).

        Errors due to the shape of the pad are averaged over the taxels that receive light, marked in ``lit`` (T,).
        """
        # The error of a central difference falls with the square of the step: extrapolate to a step of 0.
        chosen = self._chosen()
        differences = _Differences(self._scene, chosen.stencil, self._effort.seed, chosen.points)
        small, large = (differences.over(factor * chosen.step, self._walls) for factor in (1, FINER))
        extrapolated = (FINER**2 * small - large) / (FINER**2 - 1)
        errors = [standard_error(extrapolated), (extrapolated - small).mean(axis=0)]

        def mean(changes: np.ndarray) -> float:
            return _root_mean_square(changes[:, lit]) if lit.any() else 0.0

        errors += [error * lit for error in self._shape_errors(chosen, differences, small, mean)]
        return extrapolated.mean(axis=0), np.sqrt(sum(np.square(error) for error in errors))

    def _shape_errors(
        self, chosen: _Chosen, differences: _Differences, derivative: np.ndarray, mean: Mean
    ) -> list[float]:
        """Errors due to the shape of a pad, in W per unit of the parameter; empty without a pad."""
        return []

    def _chosen(self) -> _Chosen:
        """Choose step, stencil and number of points with the least error, as predicted by pilot runs."""
        effort, largest = self._effort, self._scene.largest_step(self._walls) / FINER
        pilot_points = min(FIRST_POINTS, effort.points)
        pilot, step = self._stencil(largest, derived_seed(effort.seed, PILOT), pilot_points)
        steps = [step / FINER**level for level in range(LEVELS)]
        derivatives = [pilot.over(size, self._walls) for size in steps]

        # The error due to a step follows from the difference to twice the step. As noise may hide this difference,
        # the error is at least a quarter of that of twice the step.
        step_errors, last, twice = list[float](), 0.0, pilot.over(FINER * step, self._walls)
        for derivative in derivatives:
            last = max(_root_mean_square(twice - derivative) / (FINER**2 - 1), last / FINER**2)
            step_errors.append(last)
            twice = derivative

        # Smaller steps do not have less noise, even if few pilot paths suggest it, because the rays that begin or
        # cease to hit a surface become rare.
        noise = [float(np.sqrt((standard_error(derivative) ** 2).mean())) for derivative in derivatives]
        noise = np.maximum.accumulate(noise).tolist()
        target = NOISE * float(np.sqrt((derivatives[0].mean(axis=0) ** 2).mean()))

        def points(level: int) -> int:
            if effort.fixed or not target:
                return effort.points
            most = MORE_POINTS * effort.points
            return min(max(effort.points, math.ceil(pilot_points * (noise[level] / target) ** 2)), most)

        def error(level: int) -> float:
            return math.hypot(noise[level] * math.sqrt(pilot_points / points(level)), step_errors[level])

        best = min(range(LEVELS), key=error)
        return _Chosen(steps[best], pilot.stencil, points(best))

    def _stencil(self, largest: float, seed: int, points: int) -> tuple[_Differences, float]:
        """Choose the largest step, and the first stencil, for which the scene is valid at the step and at twice the
        step."""
        for level in range(LEVELS):
            for stencil in self._stencils:
                differences, step = _Differences(self._scene, stencil, seed, points), largest / FINER**level
                try:
                    differences.over(FINER * step, self._walls)
                except (InputError, ComputationError, RuntimeError) as error:  # Mitsuba raises the last for plugins
                    refused = error
                else:
                    return differences, step
        raise InputError(
            f"{self._change.name} = {self._change.value:g} has no derivative: slightly different values are not "
            "allowed; a value inside its range is needed."
        ) from refused


class _AlongWithPad(_Along):
    """Differences of readings when a parameter moves the walls of a pad, with the errors due to the shape of the pad.
    """

    def __init__(self, effort: _Effort, pad: _PadAndSecond, change: Rates, nodal: Nodal) -> None:
        self._pad, self._mesh = pad, pad.pad.state.mesh
        self._moving = walls_on(self._mesh, pad.linear, nodal)
        has_sides = nodal.side and scatters_evenly(pad.pad.bsdf())
        stencils = (AHEAD if nodal.side > 0 else BEHIND,) if has_sides else STENCILS
        super().__init__(effort, change, self._moving, stencils)

    def _shape_errors(
        self, chosen: _Chosen, differences: _Differences, derivative: np.ndarray, mean: Mean
    ) -> list[float]:
        errors = []
        if self._pad.pad.is_curved:
            chords = MovingWalls(self._moving.displacement, self._moving.nodal, chords=True)
            errors.append(FACETS_SHARE * mean(differences.over(chosen.step, chords) - derivative))
        if self._pad.displaced:
            errors.append(self._mechanics_error(chosen, differences, derivative, mean))
        return errors

    def _mechanics_error(self, chosen: _Chosen, differences: _Differences, derivative: np.ndarray, mean: Mean) -> float:
        """Error of the derivatives due to the finite elements, from a second mesh, in W per unit of the parameter; NaN
        if unknown."""
        second, linear = self._pad.second, self._pad.second_linear
        if second is None or linear is None:
            return math.nan
        on_second = differences.over(chosen.step, walls_on(self._mesh, linear, linear.nodal(self._change)))
        least = second.least * mean(self._through_displacement(chosen, derivative))
        error = max(second.share * mean(on_second - derivative), least)
        if not self._pad.pad.mirrors:
            return error
        bent = MovingWalls(self._moving.displacement, self._moving.nodal, bent=True)
        return math.hypot(error, mean(differences.over(chosen.step, bent) - derivative))

    def _through_displacement(self, chosen: _Chosen, derivative: np.ndarray) -> np.ndarray:
        """Derivatives (R, T) through the displacement of the pad alone, in W per unit of the parameter, for R
        replicates and T taxels."""
        displacement = self._moving.nodal.displacement
        if not displacement.any():
            return np.zeros_like(derivative)
        if not (self._change.pad or self._change.beside):
            return derivative
        scene = MovedScene(self._effort.ready, replace(self._change, beside=[]))
        still = Nodal(displacement, np.zeros_like(displacement), {})
        differences = _Differences(scene, CENTRAL, self._effort.seed, chosen.points)
        return differences.over(chosen.step, MovingWalls(self._moving.displacement, still))


class _Chosen(NamedTuple):
    step: float
    stencil: Stencil
    points: int


class _Differences:
    """Derivatives of readings as finite differences; all readings share their random numbers."""

    def __init__(self, scene: MovedScene, stencil: Stencil, seed: int, points: int) -> None:
        self._scene, self.stencil, self._seed, self._points = scene, stencil, seed, points
        self._powers: dict[tuple[float, MovingWalls | None], np.ndarray] = {}

    def over(self, step: float, walls: MovingWalls | None) -> np.ndarray:
        """Derivatives (R, T) from differences of readings over ``step``, in W per unit of the parameter, for R
        replicates and T taxels.
        """
        powers = np.array([self._power(offset * step, walls) for _, offset in self.stencil])
        return np.tensordot([weight / step for weight, _ in self.stencil], powers, axes=1)

    def _power(self, offset: float, walls: MovingWalls | None) -> np.ndarray:
        key = offset, walls
        if key not in self._powers:
            self._powers[key] = self._scene.power(offset, walls, self._seed, self._points)
        return self._powers[key]


def _root_mean_square(changes: np.ndarray) -> float:
    """Root mean square over T taxels of the mean over R replicates of ``changes`` (R, T). The variance due to noise is
    subtracted."""
    squares = changes.mean(axis=0) ** 2 - standard_error(changes) ** 2
    return math.sqrt(max(float(squares.mean()), 0.0))
