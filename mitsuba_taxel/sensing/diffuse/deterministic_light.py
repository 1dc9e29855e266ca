"""Readings of diffuse cells without random numbers, if their error is small enough."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.threads import side_by_side
from mitsuba_taxel.mechanics.contact.barriers.shut_gaps import kept_off, widest_shut
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse
from mitsuba_taxel.sensing.diffuse.equal_cells import equal_at_rest, equal_cells
from mitsuba_taxel.sensing.reading.mechanics_error import combined
from mitsuba_taxel.transport.cell import Cell

if TYPE_CHECKING:
    import mitsuba as mi

FINE, COARSE = 2, 1
"""Degrees of the polynomials on a patch, for the solution that gives the reading, and for the coarser solution that
gives its error."""
READING_SHARE = 0.1
"""Standard deviation of a reading, as a fraction of its difference from the coarser solution."""
MOST_OFF = 0.01
"""Largest relative error of a reading with which derivatives are computed; it is estimated from the power of LEDs on
walls and from the light that phototransistors accept."""
HOPELESS = 0.1
"""Largest relative error of the coarser solution, estimated from the light that phototransistors accept, for which the
finer solution is computed. The finer solution takes longer, and its error is at least a tenth of that of the coarser
solution."""
MOST_HIDDEN = 3e-3
"""Largest allowed fraction of a reading whose light travels on paths that walls occlude. The solution contains this
light as if it were not occluded."""


class DeterministicLight(NamedTuple):
    """Readings of T taxels, computed without random numbers.

    Attributes
    ----------
    power, error : (T,) ndarray
        Power on the phototransistors and its error, in W. The error is one standard deviation due to patches,
        quadrature and occluded paths.
    deviation : (T,) ndarray or None
        Change of the power on coarser finite elements, in W; see `Readings`. None if no pad is loaded or it was not
        requested.
    """

    power: np.ndarray
    error: np.ndarray
    deviation: np.ndarray | None


def deterministic_light(
    scene: mi.Scene, mechanics_error: bool = True, patch_size: float | None = None
) -> DeterministicLight | None:
    """Compute the readings of a scene with diffuse cells, without random numbers.

    The error of the light is estimated from the difference between a fine solution and a coarser solution. The coarser
    solution is also used for the changes of readings on coarser finite elements.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    mechanics_error : bool
        Whether to compute the readings on coarser finite elements as well.
    patch_size : float, optional
        Size of the patches, in mm; see `DiffuseCells`.

    Returns
    -------
    DeterministicLight or None
        The readings with their errors; None if the light needs random paths or walls occlude too much of it.
    """
    try:
        cells = DiffuseCells(scene, patch_size=patch_size)
    except (NotDiffuse, ComputationError):
        return None
    # Small displacements in proportion to the error of the mechanics, for differences of readings.
    state, loaded = cells.pad.state, cells.pad.is_loaded
    deviations = state.deviations if mechanics_error and loaded else None
    probes = () if deviations is None else tuple(state.probed_share * deviations)
    # Only the first of several equal cells is solved. Cells whose walls touch a package need random paths.
    first = equal_cells(cells, state, [state.displacement], probes) if loaded else equal_at_rest(cells)
    distinct = sorted(set(first))
    if any(_touches(cells, number, probes) for number in distinct):
        return None
    # One thread for each cell: for small matrix products, starting additional BLAS threads takes longer.
    with threadpool_limits(1, "blas"):
        solutions = side_by_side(lambda number: _solved(cells, number, probes), distinct)
    solved = {number: cell for number, cell in zip(distinct, solutions, strict=True) if cell is not None}
    if len(solved) < len(distinct):
        return None
    occluded = {number: cells.occluded_fraction(*cell.flows) for number, cell in solved.items()}
    if max(occluded.values()) > MOST_HIDDEN:
        return None
    # Readings, and errors due to light and mechanics.
    led = np.array([taxel.power for taxel in cells.taxels])
    power = led * [solved[number].reading for number in first]
    error = np.hypot(led * [solved[number].error for number in first], power * [occluded[number] for number in first])
    if not (mechanics_error and loaded):
        return DeterministicLight(power, error, None)
    if deviations is None:
        return DeterministicLight(power, error, np.full_like(power, np.nan))
    changes = np.array([solved[number].changes for number in first]).T / state.probed_share
    return DeterministicLight(power, error, led * combined(changes))


def _touches(cells: DiffuseCells, number: int, deviations: tuple[np.ndarray, ...]) -> bool:
    """Whether the walls of a cell touch a package, either in the present shape or after a further displacement of the
    nodes by one of ``deviations`` (N, 3)."""
    state = cells.pad.state
    if state.bodies is None:
        return False
    walls = cells.patches(number).faces
    width = widest_shut(state.mesh, state.bodies)
    at = walls.rest + walls.carried(state.displacement)
    positions = np.concatenate([at, *(at + walls.carried(deviation) for deviation in deviations)])
    return bool(kept_off(positions.reshape(-1, 3), state.bodies, width)[1].any())


def reading_error(fine: Cell, coarse: float, cells: DiffuseCells, number: int) -> float:
    """Error of a cell's reading due to patches and quadrature: one standard deviation.

    It includes the errors of two integrals over the walls: of the LED's power, and of the light that the
    phototransistor accepts.

    Parameters
    ----------
    fine : Cell
        The solution for the reading.
    coarse : float
        Reading from the coarser solution, in W per W of the LED.
    cells : DiffuseCells
        All cells of the scene.
    number : int
        Index of the cell.

    Returns
    -------
    float
        Standard deviation in W per W of the LED.
    """
    by_patches = cells.error_factor(number) * READING_SHARE * (fine.reading - coarse)
    by_quadrature = cells.quadrature_error(number) * fine.reading
    return float(np.linalg.norm([by_patches, by_quadrature, fine.emission_error, fine.reception_error]))


class _SolvedCell(NamedTuple):
    """Results of one cell, per W of its LED: the reading, its error, its changes on coarser finite elements, and the
    flows of light between patches."""

    reading: float
    error: float
    changes: list[float]
    flows: tuple[np.ndarray, np.ndarray, np.ndarray]


def _solved(cells: DiffuseCells, number: int, deviations: tuple[np.ndarray, ...]) -> _SolvedCell | None:
    """Compute the light in a cell, in its present shape and with the nodes displaced further by each of ``deviations``
    (N, 3).

    The result is None if the coarser solution shows that even the finer solution would not resolve the light that a
    phototransistor of narrow response accepts.
    """
    patches = cells.patches(number)
    at = patches.rest + patches.carried(cells.pad.state.displacement)
    mesh = cells.light_mesh(number, COARSE)
    coarse = cells.solved(number, mesh, at)
    is_narrow = not cells.taxels[number].phototransistor.varies_slowly
    if is_narrow and coarse.reception_error > HOPELESS * coarse.reading:
        return None
    fine = cells.solved(number, cells.light_mesh(number, FINE), at)
    deviating = [cells.solved(number, mesh, at + patches.carried(deviation)) for deviation in deviations]
    changes = [cell.reading - coarse.reading for cell in deviating]
    return _SolvedCell(fine.reading, reading_error(fine, coarse.reading, cells, number), changes, fine.flows())
