"""Derivatives of the readings of diffuse cells with respect to parameters of a scene: load, material, dimensions, LED
and phototransistor.

Light in diffuse cells is computed without random numbers, so that derivatives are as accurate as readings (see
`transport`). A parameter moves the walls of the cells through the mechanics, and changes LED, phototransistor and the
reflectance of walls. The change of a reading P is dP = dP/dx . dx + dP/dq . dq, with the positions x of the walls and
the properties q of LED, phototransistor and walls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.base.processes.threads import side_by_side
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.derivatives.package_clearance import clearances
from mitsuba_taxel.sensing.derivatives.scene_rates import Rates
from mitsuba_taxel.sensing.derivatives.slope_error import Comparison, mechanics_errors, unknown
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
"""Standard deviation of derivatives, as a fraction of the difference between the finer and the coarser solution."""
HORIZON_SHARE = 1.3
"""Standard deviation of a derivative due to the smoothed horizon, as a fraction of its change with twice the width.
Compared with differences of readings of bent plates and loaded pads, this fraction is 0.5 to 2.5."""


def derivatives_by(
    changes: list[Rates],
    live: mi.Scene,
    with_errors: bool = True,
    degree: int = FINE,
    wider: float = 1.0,
    of_light_alone: bool = False,
    patch_size: float | None = None,
) -> Derivatives:
    """Compute the derivatives of the readings of diffuse cells with respect to parameters, without random numbers.

    Parameters
    ----------
    changes : list[Rates]
        Rates of the scene's parts with each parameter, from :func:`rates`.
    live : mi.Scene
        The loaded scene.
    with_errors : bool
        Whether to compute the errors, which take most of the time; else they are NaN.
    degree : int
        Degree of the polynomials on each patch. Degree 2 is the default; degree 1, allowed without errors only, is
        accurate to a percent and takes half the time.
    wider : float
        Factor of the width over which the step of isotropic light at the horizon of a patch is smoothed.
    of_light_alone : bool
        Whether to omit the strain and the clearance of the pad, which are then NaN.
    patch_size : float, optional
        Size in mm of the patches for the light instead of the default.

    Returns
    -------
    Derivatives
        Derivatives in W per unit of each parameter.

    Raises
    ------
    InputError
        if the readings have no derivative with respect to one of the parameters. The subclass `NotDiffuse` is raised if
        the light needs random paths, as with mirrors.
    ComputationError
        if the pad has no equilibrium at a neighbouring load. The subclass `NotFollowed` is raised if too much light is
        occluded, or if its computation would take too long.
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
    """A scene of diffuse cells, with the derivatives of its readings with respect to the positions of its walls. The
    pad is linearised about its state, or about another state of the same pad."""

    def __init__(self, cells: DiffuseCells, degree: int, state: State, wider: float = 1.0) -> None:
        self.cells, self.degree, self.state, self.wider = cells, degree, state, wider
        self.linear = LinearisedPad(cells.pad, state)
        self.patches = [cells.patches(number, self.state.mesh) for number in range(len(cells.cells))]

    def by(self, changes: list[Rates], with_errors: bool, of_light_alone: bool) -> Derivatives:
        nodal = [self.linear.nodal(change) for change in changes]
        scenes = [change.scenes() for change in changes]
        size = self.cells.patch_size
        changed = [[(weight, DiffuseCells(live, patch_size=size)) for weight, live in stencil] for stencil in scenes]
        displaced = self.cells.pad.is_loaded or any(change.load.any() for change in changes)
        second = self._second(changes) if with_errors and displaced else None
        # Equal cells are solved once. BLAS has one thread: for small matrix products, starting threads takes longer.
        representative = self._equal(nodal, changed, second)
        distinct = sorted(set(representative))

        def solve(number: int) -> _CellDerivatives:
            return _CellRates(self, number, nodal, changed).derivatives(with_errors, second)

        with threadpool_limits(1, "blas"):
            by_number = dict(zip(distinct, side_by_side(solve, distinct), strict=True))
        solved = [by_number[number] for number in representative]
        power = np.array([taxel.power for taxel in self.cells.taxels])[:, None]
        reading = np.array([cell.reading for cell in solved])[:, None]

        # Occluded light counts as if it were not occluded: if its fraction of a reading is small, it is an error.
        occluded = {number: self.cells.occluded_fraction(*cell.flows) for number, cell in by_number.items()}
        hidden = np.array([occluded[number] for number in representative])[:, None]
        if hidden.max() > MOST_HIDDEN:
            raise NotFollowed(
                f"derivatives are not available: walls occlude {hidden.max():.1%} of the light of a reading; at most "
                f"{MOST_HIDDEN:.1%} is allowed."
            )
        scale = np.array([_scale(change, self.cells.pad.value) for change in changes])
        blocked = 2 * hidden * reading / np.where(scale > 0, scale, np.inf)

        # Errors due to the light, the finite elements, and occluded light are independent.
        light = np.array([cell.light_errors for cell in solved])
        mechanics, of_reading = np.zeros_like(light[:, 1:]), np.zeros_like(reading)
        if displaced:
            mechanics, of_reading = mechanics_errors(
                [cell.comparison for cell in solved], reading, None if second is None else second.state
            )
        errors = np.sqrt(light[:, 1:] ** 2 + mechanics**2 + blocked**2)
        reading_errors = np.sqrt(light[:, :1] ** 2 + of_reading**2 + (hidden * reading) ** 2)
        strain = clearance = math.nan, np.full(len(changes), math.nan)
        if not of_light_alone:
            strain = self.linear.strain(nodal)
            clearance = clearances(self.state, nodal, self.cells.scene, scenes)
        return Derivatives(
            parameters=tuple(change.name for change in changes),
            units=tuple(unit_of(change.unit) for change in changes),
            values=power * np.array([cell.values for cell in solved]),
            standard_errors=power * errors,
            power=(power * reading)[:, 0],
            power_errors=(power * reading_errors)[:, 0],
            strain=strain[0],
            strain_rates=strain[1],
            clearance=clearance[0],
            clearance_rates=clearance[1],
        )

    def _second(self, changes: list[Rates]) -> _Second | None:
        """The scene linearised about its state on a second mesh; None if there is no such mesh."""
        state = self.cells.pad.second_state()
        if state is None:
            return None
        scene = _Linearised(self.cells, COARSE, state.state)
        return _Second(scene, [scene.linear.nodal(change) for change in changes], state)

    def _equal(self, nodal: list[Nodal], changed: list, second: _Second | None) -> list[int]:
        """For each cell, the index of the first cell that is its mirror image on both meshes, so that their derivatives
        are equal; its own index if there is none."""
        if any(changed):
            return list(range(len(self.patches)))
        meshes = [(self, nodal)] if second is None else [(self, nodal), (second.scene, second.nodal)]
        by_mesh = [
            equal_cells(self.cells, scene.state, [scene.state.displacement, *(rate.displacement for rate in rates)])
            for scene, rates in meshes
        ]
        classes = list(zip(*by_mesh, strict=True))
        return [classes.index(representatives) for representatives in classes]


@dataclass(frozen=True, eq=False)
class _Second:
    """The scene linearised on a second mesh, the rates of the nodes of that mesh with each parameter, and the state on
    it."""

    scene: _Linearised
    nodal: list[Nodal]
    state: SecondState


class _CellDerivatives(NamedTuple):
    """Results of one cell, per W of its LED: the reading, its derivatives (P,) with respect to P parameters, the errors
    (1 + P,) of reading and derivatives due to the light, the comparison with a second mesh, and the flows of light
    between patches."""

    reading: float
    values: np.ndarray
    light_errors: np.ndarray
    comparison: Comparison
    flows: tuple[np.ndarray, np.ndarray, np.ndarray]


class _CellRates:
    """The light in one cell, and the rates at which its walls move with each parameter."""

    def __init__(self, scene: _Linearised, number: int, nodal: list[Nodal], changed: list) -> None:
        self._scene, self._number = scene, number
        self._patches: CellPatches = scene.patches[number]
        self._rest = self._patches.rest
        self._at = self._rest + self._patches.carried(scene.state.displacement)
        self._displaced = [self._patches.carried(rate.displacement) for rate in nodal]
        self._velocities = [self._velocity(*rates) for rates in zip(nodal, self._displaced, strict=True)]
        self._sides = [rate.side for rate in nodal]
        self._changed = changed

    def derivatives(self, with_errors: bool, second: _Second | None) -> _CellDerivatives:
        """Compute the derivatives of the reading of this cell. The pairs of quadrature points, which take much memory,
        are not kept.
        """
        fine = self._solved(self._scene.degree)
        values = self._by_patch(fine, fine.gradient(self._scene.wider)).sum(axis=1)
        light, comparison = np.full(1 + len(values), np.nan), unknown(len(values))
        if with_errors:
            # The error of the finer solution is estimated from the difference between both solutions.
            coarse = self._solved(COARSE)
            gradient = coarse.gradient()
            by_patch = self._by_patch(coarse, gradient)
            fraction = self._scene.cells.error_factor(self._number) * LIGHT_SHARE
            errors = [
                fraction * (values - by_patch.sum(axis=1)),
                HORIZON_SHARE * self._change_by_wider_horizon(coarse, gradient),
                self._difference_of_sides(coarse),
                self._conservation_error(fine, values),
            ]
            of_reading = reading_error(fine, coarse.reading, self._scene.cells, self._number)
            light = np.array([of_reading, *np.linalg.norm(errors, axis=0)])

            # The coarser solution on a second mesh gives the error of the finite elements.
            if second is not None:
                comparison = self._compared(second, coarse.reading, by_patch, gradient)
        return _CellDerivatives(fine.reading, values, light, comparison, fine.flows())

    def _change_by_wider_horizon(self, coarse: Cell, gradient: np.ndarray) -> np.ndarray:
        """Changes (P,) of the derivatives if the step at the horizon is smoothed over twice the width. Only isotropic
        light has such a step."""
        if not self._scene.cells.cells[self._number].isotropic.any():
            return np.zeros(len(self._velocities))
        change = coarse.gradient(wider=2) - gradient
        return np.array([(change * velocity).sum() for velocity in self._velocities])

    def _conservation_error(self, cell: Cell, values: np.ndarray) -> np.ndarray:
        """Errors (P,) of the derivatives due to quadrature: of the light of the LED, of the light to the
        phototransistor, and of the light between walls.

        Raises
        ------
        NotFollowed
            if the integrals over the walls miss the power of the LED or the light that the phototransistor accepts by
            more than 1 %.
        """
        error = np.hypot(cell.emission_error, cell.reception_error)
        if error > MOST_OFF * cell.reading:
            raise NotFollowed("derivatives are not available: patches are too coarse for a narrow beam or response.")
        moving = np.array([cell.conservation_slope_error(velocity) for velocity in self._velocities])
        quadrature = self._scene.cells.quadrature_error(self._number)
        relative = np.hypot(quadrature, error / cell.reading if cell.reading else 0.0)
        return np.hypot(moving, relative * values)

    def _difference_of_sides(self, cell: Cell) -> np.ndarray:
        """Half the difference (P,) of the two one-sided derivatives of an unloaded pad, whose mean is the stated
        derivative; 0 if only one side is requested.
        """
        return np.array(
            [
                0.0 if side else np.ptp(self._bent(cell, velocity, side).sum(axis=1)) / 2
                for velocity, side in zip(self._velocities, self._sides, strict=True)
            ]
        )

    def _bent(self, cell: Cell, velocity: np.ndarray, side: int) -> np.ndarray:
        """One-sided derivatives of the light between points of a flat wall, which see each other only once the pad is
        displaced: an array (S, F) for S sides (one if ``side`` is given, else two) and F patches; 0 for a displaced
        pad."""
        if self._scene.state.displacement.any():
            return np.zeros((1, len(self._rest)))
        return np.array([cell.bent(velocity, sign) for sign in ((side,) if side else (1, -1))])

    def _compared(self, second: _Second, reading: float, by_patch: np.ndarray, gradient: np.ndarray) -> Comparison:
        """Differences between the derivatives on the second mesh and on the first mesh. Both use the coarser solution
        of the light.
        """
        second_rates = _CellRates(second.scene, self._number, second.nodal, self._changed)
        cell = second_rates._solved(COARSE)
        second_gradient = cell.gradient()
        change = second_rates._by_patch(cell, second_gradient) - by_patch
        pairs = zip(self._velocities, second_rates._velocities, strict=True)
        kinks = np.array([((second_gradient - gradient) * (second - own)).sum() for own, second in pairs])
        displaced = np.array([(gradient * rate).sum() for rate in self._displaced])
        independent = np.sqrt((change**2).sum(axis=1))
        return Comparison(np.array([cell.reading - reading, *change.sum(axis=1)]), independent, kinks, displaced)

    def _solved(self, degree: int) -> Cell:
        cells = self._scene.cells
        return cells.solved(self._number, cells.light_mesh(self._number, degree), self._at)

    def _velocity(self, nodal: Nodal, displaced: np.ndarray) -> np.ndarray:
        """Velocity (F, 15, 3) of the 15 nodes of each of F patches of the deformed walls, in mm per unit of the
        parameter."""
        displacement = self._scene.state.displacement
        dimensions = (rate * self._patches.moved(name, displacement) for name, rate in nodal.dimensions.items())
        return sum(dimensions, start=displaced)

    def _by_patch(self, cell: Cell, gradient: np.ndarray) -> np.ndarray:
        """Contributions (P, F + 1) to each of P derivatives: those of the movement of each of F patches, then that of
        changes of LED, phototransistor, package and reflectances."""
        by_walls = [
            (gradient * velocity).sum(axis=(1, 2)) + self._bent(cell, velocity, side).mean(axis=0)
            for velocity, side in zip(self._velocities, self._sides, strict=True)
        ]
        return np.column_stack([by_walls, [self._by_parts(cell, gradient, scenes) for scenes in self._changed]])

    def _by_parts(self, cell: Cell, gradient: np.ndarray, scenes: list[tuple[float, DiffuseCells]]) -> float:
        """Derivative of the reading through changes of LED, phototransistor, package and reflectances: a finite
        difference over the scenes and weights in ``scenes``."""
        present, taxel = self._scene.cells.cells[self._number], self._scene.cells.taxels[self._number]
        derivative = 0.0
        for weight, changed in scenes:
            changed_taxel = changed.taxels[self._number]
            changed_cell = changed.cell_like(self._number, self._scene.cells)
            reflectance = changed_cell.isotropic + changed_cell.lambertian
            ratio = reflectance / (present.isotropic + present.lambertian)
            change = cell.change(changed_taxel.led, changed_taxel.phototransistor, changed_taxel.body, ratio)
            change += (gradient[len(present.cuts.parent) :] * (changed_cell.package - present.package)).sum()
            derivative += weight * (change + cell.reading * changed_taxel.power / taxel.power)
        return derivative


def _scale(change: Rates, load: Sequence[float]) -> float:
    """Magnitude by which a parameter is scaled: the magnitude of its value, or of the whole load if it is one of its
    components.
    """
    return float(np.linalg.norm(load)) if change.load.any() else abs(change.value)
