"""Derivatives of readings by parameters of a scene: force, material, dimensions, parts.

Light in diffuse cells is computed without random numbers, so that derivatives are as accurate as readings (see
`transport`). A parameter moves the walls of the cells through the mechanics, and changes LED, phototransistor and the
scattering of walls: dP = dP/dx . dx + dP/d(ends).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_taxel.base import stages
from mitsuba_taxel.base.threads import side_by_side
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.derivatives.package_clearance import clearances
from mitsuba_taxel.sensing.derivatives.scene_rates import Rates
from mitsuba_taxel.sensing.derivatives.slope_error import Against, mechanics_errors, unknown
from mitsuba_taxel.sensing.diffuse.deterministic_light import COARSE, FINE, MOST_HIDDEN, MOST_OFF, reading_error
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells, NotFollowed
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse
from mitsuba_taxel.sensing.diffuse.equal_cells import equal_cells
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives, unit_of
from mitsuba_taxel.transport.cell import Cell

if TYPE_CHECKING:
    import mitsuba as mi

    from mitsuba_taxel.mechanics import State
    from mitsuba_taxel.mechanics.errors.second_state import SecondState
    from mitsuba_taxel.sensing.diffuse.cell_patches import CellPatches

LIGHT_SHARE = 0.25
"""Standard deviation of the derivatives of the finer solution, relative to their difference from the coarser one's."""
HORIZON_SHARE = 1.3
"""Standard deviation of a derivative, relative to its change with a horizon of twice the width: compared with
differences of readings of bent plates and loaded pads, it is 0.5 to 2.5."""


def derivatives_by(
    changes: list[Rates],
    live: mi.Scene,
    with_errors: bool = True,
    degree: int = FINE,
    wider: float = 1.0,
    of_light_alone: bool = False,
    patch_size: float | None = None,
) -> Derivatives:
    """Derivatives of the readings of a loaded scene by the parameters whose :func:`rates` are given.

    Parameters
    ----------
    with_errors : bool
        Whether to compute errors, which take most of the time; else they are NaN.
    degree : int
        Of the solutions on a patch; degree 1, available without errors, is accurate to a percent in half the time.
    wider : float
        Factor of the width over which the step at the horizon is spread.
    of_light_alone : bool
        Whether to leave out strain and clearance of the pad; they are NaN then.
    patch_size : float, optional
        Size in mm of the patches for the light instead of the default.

    Raises
    ------
    InputError
        if the scene has no derivative by one of them; `NotDiffuse` if its light needs random paths, as with mirrors.
    ComputationError
        if there is no equilibrium nearby; `NotFollowed` if too much light is occluded, or takes too long.
    """
    try:
        with stages.stage("derivatives"):
            cells = DiffuseCells(live, patch_size=patch_size)
            begins = not cells.pad.is_loaded and any(change.load.any() for change in changes)
            state = cells.pad.at_onset() if begins else cells.pad.state
            return _Linearised(cells, degree, state, wider).by(changes, with_errors, of_light_alone)
    except NotDiffuse as reason:
        raise NotDiffuse(f"derivatives are not available: {reason}.") from reason


class _Linearised:
    """A scene of diffuse cells, and the derivatives of its readings by the positions of its walls, in the pad's state
    or another one of the same pad."""

    def __init__(self, cells: DiffuseCells, degree: int, state: State, wider: float = 1.0) -> None:
        self.cells, self.degree, self.state, self.wider = cells, degree, state, wider
        self.linear = LinearisedPad(cells.pad, state)
        self.patches = [cells.patches(number, self.state.mesh) for number in range(len(cells.cells))]

    def by(self, changes: list[Rates], with_errors: bool, of_light_alone: bool) -> Derivatives:
        nodal = [self.linear.nodal(change) for change in changes]
        scenes = [change.scenes() for change in changes]
        size = self.cells.patch_size
        others = [[(weight, DiffuseCells(live, patch_size=size)) for weight, live in each] for each in scenes]
        displaced = self.cells.pad.is_loaded or any(change.load.any() for change in changes)
        second = self._second(changes) if with_errors and displaced else None
        first = self._equal(nodal, others, second)
        alone = sorted(set(first))

        def found(number: int) -> _Found:
            return _OfCell(self, number, nodal, others).found(with_errors, second)

        # Many small matrix products: each would start and wait for its own threads.
        with threadpool_limits(1, "blas"):
            by_number = dict(zip(alone, side_by_side(found, alone), strict=True))
        solved = [by_number[number] for number in first]
        power = np.array([taxel.power for taxel in self.cells.taxels])[:, None]
        shares = {number: self.cells.hidden_share(*each.flows) for number, each in by_number.items()}
        hidden = np.array([shares[number] for number in first])[:, None]
        reading = np.array([each.reading for each in solved])[:, None]
        if hidden.max() > MOST_HIDDEN:
            raise NotFollowed(
                f"derivatives are not available: {hidden.max():.1%} of a reading comes by ways that walls stand in."
            )
        scale = np.array([_scale(change, self.cells.pad.value) for change in changes])
        blocked = 2 * hidden * reading / np.where(scale > 0, scale, np.inf)
        light = np.array([each.light_errors for each in solved])
        mechanics, of_reading = np.zeros_like(light[:, 1:]), np.zeros_like(reading)
        if displaced:
            mechanics, of_reading = mechanics_errors(
                [each.against for each in solved], reading, None if second is None else second.told
            )
        errors = np.sqrt(light[:, 1:] ** 2 + mechanics**2 + blocked**2)
        reading_errors = np.sqrt(light[:, :1] ** 2 + of_reading**2 + (hidden * reading) ** 2)
        strain = clearance = math.nan, np.full(len(changes), math.nan)
        if not of_light_alone:
            strain = self.linear.strain(nodal)
            clearance = clearances(self.state, nodal, self.cells.scene, scenes)
        return Derivatives(
            tuple(change.name for change in changes),
            tuple(unit_of(change.unit) for change in changes),
            power * np.array([each.values for each in solved]),
            power * errors,
            (power * reading)[:, 0],
            (power * reading_errors)[:, 0],
            *strain,
            *clearance,
        )

    def _second(self, changes: list[Rates]) -> _Second | None:
        """The same on a second mesh; None if no mesh tells the error."""
        found = self.cells.pad.second_state()
        if found is None:
            return None
        whole = _Linearised(self.cells, COARSE, found.state)
        return _Second(whole, [whole.linear.nodal(change) for change in changes], found)

    def _equal(self, nodal: list[Nodal], others: list, second: _Second | None) -> list[int]:
        """The representative cell of each cell."""
        if any(others):
            return list(range(len(self.patches)))
        sides = [(self, nodal)] if second is None else [(self, nodal), (second.whole, second.nodal)]
        first = [
            equal_cells(self.cells, whole.state, [whole.state.displacement, *(each.displacement for each in rates)])
            for whole, rates in sides
        ]
        both = list(zip(*first, strict=True))
        return [both.index(each) for each in both]


@dataclass(frozen=True, eq=False)
class _Second:
    """A second mesh, and what a difference from it tells."""

    whole: _Linearised
    nodal: list[Nodal]
    told: SecondState


class _Found(NamedTuple):
    """Results of a cell: its reading per W of its LED, the derivatives by each change, errors (1 + P) of both by the
    light, the comparison with a second mesh, and its light paths."""

    reading: float
    values: np.ndarray
    light_errors: np.ndarray
    against: Against
    flows: tuple[np.ndarray, np.ndarray, np.ndarray]


class _OfCell:
    """One cell, and the rates of its walls."""

    def __init__(self, whole: _Linearised, number: int, nodal: list[Nodal], others: list) -> None:
        self._whole, self._number = whole, number
        self._patches: CellPatches = whole.patches[number]
        self._rest = self._patches.rest
        self._at = self._rest + self._patches.carried(whole.state.displacement)
        self._displaced = [self._patches.carried(each.displacement) for each in nodal]
        self._velocities = [self._velocity(*each) for each in zip(nodal, self._displaced, strict=True)]
        self._sides = [each.side for each in nodal]
        self._others = others

    def found(self, with_errors: bool, second: _Second | None) -> _Found:
        """Results of the cell, without its pairs of points, which take much memory."""
        fine = self._solved(self._whole.degree)
        values = self._by_patch(fine, fine.gradient(self._whole.wider)).sum(axis=1)
        light, against = np.full(1 + len(values), np.nan), unknown(len(values))
        if with_errors:
            coarse = self._solved(COARSE)
            gradient = coarse.gradient()
            by_patch = self._by_patch(coarse, gradient)
            there = by_patch.sum(axis=1)
            spread = self._of_wider_horizon(coarse, gradient)
            share = self._whole.cells.light_share(self._number)
            conservation = self._of_conservation(fine, values)
            changes = [
                share * LIGHT_SHARE * (values - there),
                HORIZON_SHARE * spread,
                self._of_sides(coarse),
                conservation,
            ]
            of_derivatives = np.linalg.norm(changes, axis=0)
            of_reading = reading_error(fine, coarse.reading, self._whole.cells, self._number)
            light = np.array([of_reading, *of_derivatives])
            if second is not None:
                against = self._against(second, coarse.reading, by_patch, gradient)
        return _Found(fine.reading, values, light, against, fine.flows())

    def _of_wider_horizon(self, coarse: Cell, gradient: np.ndarray) -> np.ndarray:
        """(P,) changes of the derivatives with a horizon of twice the width, which only isotropic light has."""
        if not self._whole.cells.cells[self._number].isotropic.any():
            return np.zeros(len(self._velocities))
        change = coarse.gradient(wider=2) - gradient
        return np.array([(change * velocity).sum() for velocity in self._velocities])

    def _of_conservation(self, cell: Cell, values: np.ndarray) -> np.ndarray:
        """(P,) errors of the derivatives by the light between the walls and LED and phototransistor, and by quadrature.

        Raises
        ------
        NotFollowed
            if integrals over walls differ from those along their outlines.
        """
        error = np.hypot(cell.emission_error, cell.reception_error)
        if error > MOST_OFF * cell.reading:
            raise NotFollowed("derivatives are not available: patches are too coarse for a narrow beam or response.")
        moving = np.array([cell.conservation_slope_error(velocity) for velocity in self._velocities])
        quadrature = self._whole.cells.quadrature_share(self._number)
        relative = np.hypot(quadrature, error / cell.reading if cell.reading else 0.0)
        return np.hypot(moving, relative * values)

    def _of_sides(self, cell: Cell) -> np.ndarray:
        """(P,) how far derivatives that are the mean of those on two sides are from either."""
        each = zip(self._velocities, self._sides, strict=True)
        return np.array([0.0 if side else np.ptp(self._bent(cell, rate, side).sum(axis=1)) / 2 for rate, side in each])

    def _bent(self, cell: Cell, velocity: np.ndarray, side: int) -> np.ndarray:
        """(S, F) derivatives of the light between points of one plane, which walls at rest have: on the side on which
        the pad is pressed, or on both."""
        if self._whole.state.displacement.any():
            return np.zeros((1, len(self._rest)))
        return np.array([cell.bent(velocity, one) for one in ((side,) if side else (1, -1))])

    def _against(self, second: _Second, reading: float, by_patch: np.ndarray, gradient: np.ndarray) -> Against:
        """The coarser solution compared with that of a second mesh."""
        other = _OfCell(second.whole, self._number, second.nodal, self._others)
        cell = other._solved(COARSE)
        there = cell.gradient()
        change = other._by_patch(cell, there) - by_patch
        both = zip(self._velocities, other._velocities, strict=True)
        kinks = np.array([((there - gradient) * (velocity - own)).sum() for own, velocity in both])
        displaced = np.array([(gradient * rate).sum() for rate in self._displaced])
        apart = np.sqrt((change**2).sum(axis=1))
        return Against(np.array([cell.reading - reading, *change.sum(axis=1)]), apart, kinks, displaced)

    def _solved(self, degree: int) -> Cell:
        cells = self._whole.cells
        return cells.solved(self._number, cells.light_mesh(self._number, degree), self._at)

    def _velocity(self, nodal: Nodal, displaced: np.ndarray) -> np.ndarray:
        """(F, 15, 3) velocity of the deformed walls."""
        displacement = self._whole.state.displacement
        dimensions = (rate * self._patches.moved(name, displacement) for name, rate in nodal.dimensions.items())
        return sum(dimensions, start=displaced)

    def _by_patch(self, cell: Cell, gradient: np.ndarray) -> np.ndarray:
        """(P, F + 1) derivatives by the movement of each patch of walls, and by changes of other parts."""
        by_walls = [
            (gradient * velocity).sum(axis=(1, 2)) + self._bent(cell, velocity, side).mean(axis=0)
            for velocity, side in zip(self._velocities, self._sides, strict=True)
        ]
        return np.column_stack([by_walls, [self._by_parts(cell, gradient, scenes) for scenes in self._others]])

    def _by_parts(self, cell: Cell, gradient: np.ndarray, scenes: list[tuple[float, DiffuseCells]]) -> float:
        own, taxel = self._whole.cells.cells[self._number], self._whole.cells.taxels[self._number]
        total = 0.0
        for weight, other in scenes:
            then = other.taxels[self._number]
            there = other.cell_like(self._number, self._whole.cells)
            scattered = (there.isotropic + there.lambertian) / (own.isotropic + own.lambertian)
            change = cell.change(then.led, then.phototransistor, then.body, scattered)
            change += (gradient[len(own.cuts.parent) :] * (there.package - own.package)).sum()
            total += weight * (change + cell.reading * then.power / taxel.power)
        return total


def _scale(change: Rates, load: Sequence[float]) -> float:
    """Scale of a parameter: its value, or that of the load of which it is a component."""
    return float(np.linalg.norm(load)) if change.load.any() else abs(change.value)
