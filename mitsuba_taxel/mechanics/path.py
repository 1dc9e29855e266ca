"""The deformed pad at any force, by way of one path that everybody shares.

The path to a force F is 0 -> (0, 0, Fz) -> F: the normal leg first, then the tangential one, as in the paper's
procedure and on the bench. Its nodes depend on pad, material and mesh alone, so that a state is the same to the bit
whoever asks for it, with whatever others, in any order.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from importlib.metadata import version

import numpy as np

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.equilibrium import RESIDUAL_TOLERANCE, LoadedPad, natural_step
from mitsuba_taxel.mechanics.leg import INTERPOLATION_TOLERANCE, Interpolated, Leg
from mitsuba_taxel.mechanics.materials import NeoHookean
from mitsuba_taxel.mechanics.solvers import available_solvers
from mitsuba_taxel.pads.meshing import DEFAULT_MESH_SIZE, mesh_pad
from mitsuba_taxel.pads.pad import REGIONS, Pad
from mitsuba_taxel.pads.volume_mesh import VolumeMesh

_LOCK = threading.RLock()


@dataclass(frozen=True, eq=False)
class State:
    """A deformed pad.

    Attributes
    ----------
    mesh : undeformed mesh
    force : (3,) total force on the top, in N
    displacement : (N, 3) of each node, in mm
    pressure : (corners,) MPa, positive in tension
    min_jacobian : least volume ratio J at the ends of the interval that the state lies in
    residual : largest out-of-balance force there, relative to the load
    newton_iterations : iterations of the last solve
    stability_checked : whether the solver gave the inertia that stability was judged by
    """

    mesh: VolumeMesh
    force: np.ndarray
    displacement: np.ndarray
    pressure: np.ndarray
    min_jacobian: float
    residual: float
    newton_iterations: int
    stability_checked: bool


def load_path(
    pad: Pad,
    material: NeoHookean,
    forces: Sequence[Sequence[float]] | np.ndarray,
    *,
    mesh_size: float = DEFAULT_MESH_SIZE,
    progress: Callable[[int, int], None] | None = None,
) -> list[State]:
    """Deformed states of a pad under each of ``forces``.

    Parameters
    ----------
    forces : (S, 3) total forces on the top in N; compression is Fz < 0
    mesh_size : size of the finite elements in mm
    progress : called with the number of states done and the number of all

    Raises
    ------
    InputError
        for forces that are not finite, or a mesh size that is not allowed.
    ComputationError
        naming the force beyond which the pad cannot be loaded.
    """
    rows = _checked(forces)
    states = []
    with _LOCK:
        path = _path(pad, material, float(mesh_size))
        for done, force in enumerate(rows, start=1):
            states.append(path.state(force))
            if progress:
                progress(done, len(rows))
    return states


def _checked(forces: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    """The forces as an array (S, 3); raises `InputError`."""
    try:
        rows = np.asarray(forces, dtype=float)
    except (TypeError, ValueError):
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != 3 or not np.all(np.isfinite(rows)):
        shown = np.asarray(forces, dtype=object).tolist()
        raise InputError(f"forces = {shown} is not allowed: rows of three finite numbers are needed.")
    return rows


class _Path:
    """Mesh and legs of one pad of one material, kept on disk and in memory."""

    def __init__(self, pad: Pad, material: NeoHookean, mesh_size: float) -> None:
        self.pad, self.material, self.mesh_size = pad, material, mesh_size
        self._identity = [asdict(pad), mesh_size, version("netgen-mesher")]
        self._legs: dict[tuple[float, ...], Leg] = {}

    @cached_property
    def mesh(self) -> VolumeMesh:
        name = cache.key("mesh", self._identity)
        arrays = cache.load(name)
        if arrays is None:
            mesh = mesh_pad(self.pad, self.mesh_size)
            cache.store(name, vars(mesh))
            return mesh
        return VolumeMesh(**arrays)

    @cached_property
    def _free(self) -> np.ndarray:
        """(N,) whether each node may move."""
        free = np.ones(len(self.mesh.points), dtype=bool)
        free[self.mesh.faces[self.mesh.face_region == REGIONS["bottom"]]] = False
        return free

    @cached_property
    def loaded(self) -> LoadedPad:
        return LoadedPad(self.mesh, self.material)

    def state(self, force: np.ndarray) -> State:
        """The deformed pad under ``force``."""
        normal, tangential = force[2], float(np.hypot(force[0], force[1]))
        if not force.any():
            return self._state(force, self._rest)
        if tangential == 0:
            return self._state(force, self._normal(normal))
        direction = np.round(np.array([force[0], force[1], 0.0]) / tangential, 12)
        leg = self._leg((0.0, 0.0, normal), direction)
        if not leg.reaches(tangential):
            self._extend(leg, tangential, self._normal(normal).unknowns if normal else self._rest.unknowns)
        return self._state(force, leg.at(tangential))

    def _normal(self, normal: float) -> Interpolated:
        leg = self._leg((0.0, 0.0, 0.0), np.array([0.0, 0.0, np.sign(normal)]))
        if not leg.reaches(abs(normal)):
            self._extend(leg, abs(normal), self._rest.unknowns)
        return leg.at(abs(normal))

    @property
    def _rest(self) -> Interpolated:
        unknowns = 3 * np.count_nonzero(self._free) + self.mesh.corner_count
        return Interpolated(np.zeros(unknowns), 1.0, 0.0, 0, True)

    def _leg(self, origin: tuple[float, float, float], direction: np.ndarray) -> Leg:
        index = (*origin, *direction)
        if index not in self._legs:
            top_area = self.pad.extent[0] * self.pad.extent[1]
            leg = Leg(np.array(origin), direction, natural_step(self.material, top_area))
            arrays = cache.load(self._leg_name(leg))
            if arrays is not None:
                leg.restore(arrays)
            self._legs[index] = leg
        return self._legs[index]

    def _extend(self, leg: Leg, s: float, start: np.ndarray) -> None:
        before = len(leg.nodes)
        try:
            leg.extend(self.loaded, s, start)
        finally:
            if len(leg.nodes) > before:
                cache.store(self._leg_name(leg), leg.arrays())

    def _leg_name(self, leg: Leg) -> str:
        material = [type(self.material).__name__, asdict(self.material)]
        numerics = [leg.step, RESIDUAL_TOLERANCE, INTERPOLATION_TOLERANCE, available_solvers()[0]]
        return cache.key("leg", self._identity, material, numerics, leg.origin.tolist(), leg.direction.tolist())

    def _state(self, force: np.ndarray, at: Interpolated) -> State:
        displacement = np.zeros((len(self.mesh.points), 3))
        count = 3 * np.count_nonzero(self._free)
        displacement[self._free] = at.unknowns[:count].reshape(-1, 3)
        figures = (at.min_jacobian, at.residual, at.iterations, at.stability_checked)
        return State(self.mesh, np.array(force), displacement, at.unknowns[count:], *figures)


@lru_cache(maxsize=8)
def _path(pad: Pad, material: NeoHookean, mesh_size: float) -> _Path:
    return _Path(pad, material, mesh_size)
