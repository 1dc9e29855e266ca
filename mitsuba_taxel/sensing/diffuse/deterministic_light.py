"""Readings of diffuse cells without random numbers, wherever their error is small enough."""

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
"""Degrees of the solutions on a patch, the coarser one for the error of the finer one."""
READING_SHARE = 0.1
"""Standard deviation of a reading, relative to its difference from that of the coarser solution."""
MOST_OFF = 0.01
"""Largest error by the power of LEDs on walls and by what phototransistors accept, as share of a reading, with which
there are derivatives."""
HOPELESS = 0.1
"""Relative error of the coarser solution by what phototransistors accept above which there is no finer one, which takes
longer and would have a tenth of that at least."""
MOST_HIDDEN = 3e-3
"""Largest share of a reading on paths that walls stand in, which are followed as if these were not there."""


class DeterministicLight(NamedTuple):
    """Readings of all taxels.

    Attributes
    ----------
    power, error : (T,) ndarray
        In W; one standard deviation by patches, quadrature and occluded paths.
    deviation : (T,) ndarray or None
        In W, as in `Readings`; None if no pad is loaded or it was not requested.
    """

    power: np.ndarray
    error: np.ndarray
    deviation: np.ndarray | None


def deterministic_light(
    scene: mi.Scene, mechanics_error: bool = True, patch_size: float | None = None
) -> DeterministicLight | None:
    """Readings of a scene of diffuse cells, without random numbers.

    The coarser solution gives the error, and the changes of readings with coarser finite elements.

    Parameters
    ----------
    scene : mi.Scene
        A loaded one.
    mechanics_error : bool
        Whether to read the pad on coarser finite elements as well.
    patch_size : float, optional
        In mm, as of `DiffuseCells`.

    Returns
    -------
    DeterministicLight or None
        None if the scene is of another kind, or its light is blocked too often.
    """
    try:
        cells = DiffuseCells(scene, patch_size=patch_size)
    except (NotDiffuse, ComputationError):
        return None
    state, loaded = cells.pad.state, cells.pad.is_loaded
    deviations = state.deviations if mechanics_error and loaded else None
    known = () if deviations is None else tuple(state.probed_share * deviations)
    first = equal_cells(cells, state, [state.displacement], known) if loaded else equal_at_rest(cells)
    alone = sorted(set(first))
    if any(_touches(cells, number, known) for number in alone):
        return None  # what is shut is not followed
    # Many small matrix products: each would start and wait for its own threads.
    with threadpool_limits(1, "blas"):
        each = side_by_side(lambda number: _found(cells, number, known), alone)
    found = {number: one for number, one in zip(alone, each, strict=True) if one is not None}
    if len(found) < len(alone):
        return None
    hidden = {number: cells.hidden_share(*one.flows) for number, one in found.items()}
    if max(hidden.values()) > MOST_HIDDEN:
        return None
    led = np.array([taxel.power for taxel in cells.taxels])
    power = led * [found[number].reading for number in first]
    error = np.hypot(led * [found[number].error for number in first], power * [hidden[number] for number in first])
    if not (mechanics_error and loaded):
        return DeterministicLight(power, error, None)
    if deviations is None:
        return DeterministicLight(power, error, np.full_like(power, np.nan))
    changes = np.array([found[number].changes for number in first]).T / state.probed_share
    return DeterministicLight(power, error, led * combined(changes))


def _touches(cells: DiffuseCells, number: int, deviations: tuple[np.ndarray, ...]) -> bool:
    """Whether the walls of a cell touch a package, or would, displaced by the error of the mechanics."""
    state, walls = cells.pad.state, cells.patches(number).faces
    if state.bodies is None:
        return False
    width = widest_shut(state.mesh, state.bodies)
    at = walls.rest + walls.carried(state.displacement)
    places = [at, *(at + walls.carried(part) for part in deviations)]
    return bool(kept_off(np.concatenate(places).reshape(-1, 3), state.bodies, width)[1].any())


def reading_error(fine: Cell, coarse: float, cells: DiffuseCells, number: int) -> float:
    """Standard deviation of a cell's reading by patches and quadrature, in W per W.

    It includes what the integrals over the walls add to the power of the LED and to what the phototransistor accepts,
    or leave out.
    """
    by_patches = cells.light_share(number) * READING_SHARE * (fine.reading - coarse)
    by_quadrature = cells.quadrature_share(number) * fine.reading
    return float(np.linalg.norm([by_patches, by_quadrature, fine.emission_error, fine.reception_error]))


class _Found(NamedTuple):
    """Reading of a cell per W of its LED, its error, its changes with coarser elements, and its light paths."""

    reading: float
    error: float
    changes: list[float]
    flows: tuple[np.ndarray, np.ndarray, np.ndarray]


def _found(cells: DiffuseCells, number: int, deviations: tuple[np.ndarray, ...]) -> _Found | None:
    """None if the coarser solution shows that the finer one would not resolve what the phototransistor accepts."""
    patches = cells.patches(number)
    at = patches.rest + patches.carried(cells.pad.state.displacement)
    mesh = cells.light_mesh(number, COARSE)
    coarse = cells.solved(number, mesh, at)
    before = coarse.reading
    if coarse.reception_error > HOPELESS * before:
        return None
    fine = cells.solved(number, cells.light_mesh(number, FINE), at)
    changes = [cells.solved(number, mesh, at + patches.carried(part)).reading - before for part in deviations]
    error = reading_error(fine, before, cells, number)
    return _Found(fine.reading, error, changes, fine.flows())
