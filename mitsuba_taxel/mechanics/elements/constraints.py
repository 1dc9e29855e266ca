"""Numbering of the unknowns under constraints: fixed at the board, on planes of symmetry, tied to a rigid plate.

A degree of freedom is fixed, or equals plus or minus one unknown; several may equal the same unknown. Assembly then
needs no constraint equations, and matrices remain symmetric. A plate that may tilt adds the displacements of its
:class:`~mitsuba_taxel.mechanics.elements.plate_rotation.PlateRotation`, which are not linear in its unknowns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.mirror import MIRRORS, Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.plate_rotation import PlateRotation

_NO_WALLS: Mapping[Mirror, int] = {}


@dataclass(frozen=True, eq=False)
class Numbering:
    """The unknowns of a mesh: displacements, then pressures.

    Attributes
    ----------
    unknown : (3 N + corners,) ndarray
        Unknown of each displacement (x, y, z of each node) and pressure; -1 where it is 0.
    sign : (3 N + corners,) ndarray
        Factor of the unknown.
    nodes : int
        Number N of nodes.
    displacements, pressures : int
        Numbers of unknowns of each kind.
    plate : (3,) ndarray or None
        Unknown of each component of the plate's displacement, -1 where it is 0; None without a plate.
    plate_sign : ndarray or None
        (3,) factor of these unknowns.
    rotation : PlateRotation or None
        Rotation of the plate; None if it does not rotate.
    """

    unknown: np.ndarray
    sign: np.ndarray
    nodes: int
    displacements: int
    pressures: int
    plate: np.ndarray | None = None
    plate_sign: np.ndarray | None = None
    rotation: PlateRotation | None = None

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (N, 3) and pressure (corners,) of a vector of unknowns."""
        displacement, pressure = self._split_linearly(unknowns)
        if self.rotation is not None:
            displacement[self.rotation.nodes] += self.rotation.displacement(self.rotation.turns_of(unknowns))
        return displacement, pressure

    def split_rate(self, rate: np.ndarray, displacement: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Rates of displacement (N, 3) and pressure (corners,), from the ``rate`` of the unknowns.

        They depend on the state only if the plate rotates: on its ``displacement`` (N, 3); None for the state at rest.
        """
        moving, pressing = self._split_linearly(rate)
        if self.rotation is not None:
            moving[self.rotation.nodes] += self.rotation.rates(displacement) @ self.rotation.turns_of(rate)
        return moving, pressing

    def _split_linearly(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = np.where(self.unknown >= 0, self.sign * unknowns[self.unknown], 0.0)
        return values[: 3 * self.nodes].reshape(-1, 3), values[3 * self.nodes :]

    def gather(self, displacement: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """The unknowns of a state that satisfies the constraints; the inverse of :meth:`split`."""
        unknowns = np.zeros(self.displacements + self.pressures)
        free = self.unknown >= 0
        if self.rotation is not None:
            turns = self.rotation.turns_at(displacement)
            displacement = displacement.copy()
            displacement[self.rotation.nodes] -= self.rotation.displacement(turns)
        values = np.concatenate([displacement.ravel(), pressure])
        unknowns[self.unknown[free]] = (self.sign * values)[free]
        if self.rotation is not None:
            unknowns[self.rotation.unknowns] = self.rotation.over_unknowns @ turns
        return unknowns

    def summed(self, forces: np.ndarray, displacement: np.ndarray | None = None) -> np.ndarray:
        """Sum (unknowns,) of the nodal forces (N, 3) that act on each unknown; see :meth:`over_unknowns`."""
        residual = np.concatenate([forces.ravel(), np.zeros(len(self.unknown) - forces.size)])
        return self.over_unknowns(residual, displacement)

    def over_unknowns(self, residual: np.ndarray, displacement: np.ndarray | None = None) -> np.ndarray:
        """Sum (unknowns,) of the forces on nodes and the volumes at corners, (3 N + corners,), that belong to each
        unknown.

        The moments of forces on a plate that rotates depend on its ``displacement`` (N, 3); None for the state at rest.
        """
        free = self.unknown >= 0
        total = self.displacements + self.pressures
        sums = np.bincount(self.unknown[free], (self.sign * residual)[free], total)
        if self.rotation is not None:
            forces = residual[: 3 * self.nodes].reshape(-1, 3)[self.rotation.nodes]
            moments = np.einsum("pik,pi->k", self.rotation.rates(displacement), forces)
            sums[self.rotation.unknowns] = self.rotation.spread.T @ moments
        return sums

    @property
    def plate_unknowns(self) -> np.ndarray:
        """Numbers (k,) of the unknowns that are components of the plate's displacement."""
        assert self.plate is not None
        return np.unique(self.plate[self.plate >= 0])

    def on_plate(self, wrench: np.ndarray) -> np.ndarray:
        """Convert a load on the plate to a vector over all unknowns: a force (3,) in N or, if the plate rotates, a
        force and a moment (6,).
        """
        assert self.plate is not None and self.plate_sign is not None
        moving = self.plate >= 0
        weights = (self.plate_sign * wrench[:3])[moving]
        along = np.bincount(self.plate[moving], weights=weights, minlength=self.displacements + self.pressures)
        if self.rotation is not None:
            along[self.rotation.unknowns] = self.rotation.spread.T @ wrench[3:] / self.rotation.size
        return along

    def of_plate(self, forces: np.ndarray) -> np.ndarray:
        """Force (3,) on the plate that is equivalent to ``forces`` on the unknowns; the inverse of :meth:`on_plate`."""
        assert self.plate is not None and self.plate_sign is not None
        sharing = np.array([np.count_nonzero(self.plate == unknown) for unknown in self.plate])
        return np.where(self.plate >= 0, self.plate_sign * forces[self.plate] / sharing, 0.0)

    def plate_values(self, displacement: np.ndarray) -> np.ndarray:
        """Values (k,) of the unknowns :attr:`plate_unknowns` for a displacement (3,) of the plate that its constraints
        allow."""
        assert self.plate is not None and self.plate_sign is not None
        first = [int(np.flatnonzero(self.plate == unknown)[0]) for unknown in self.plate_unknowns]
        return (self.plate_sign * displacement)[first]


def number_unknowns(
    mesh: VolumeMesh,
    fixed: np.ndarray,
    walls: Mapping[Mirror, int] = _NO_WALLS,
    plate: np.ndarray | None = None,
    pivot: np.ndarray | None = None,
) -> Numbering:
    """Number the unknowns of a mesh.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    fixed : (N,) ndarray
        Whether each node is fixed.
    walls : Mapping[Mirror, int]
        Planes of symmetry that bound the mesh, with 1 for symmetric states, -1 for antisymmetric ones, and 0 for any
        states without pressure there.
    plate : ndarray, optional
        Nodes that move together, as on a rigid plate.
    pivot : (3,) ndarray, optional
        Point of the plate in mm, on all walls, if the plate rotates: its displacement is that of the plate.

    Returns
    -------
    Numbering
        Numbers of displacements, then pressures.
    """
    nodes, corners = len(mesh.points), mesh.corner_count
    body = _Dofs(np.append(fixed, [False, False]), corners)  # the plate is an additional node, its rotation another
    for mirror in MIRRORS:  # diagonal ones last: they tie components that the others may fix
        if mirror not in walls:
            continue
        on_plane = np.append(mirror.side(mesh.points) == 0, True)
        body.reflect(np.flatnonzero(on_plane), mirror, walls[mirror])
        body.reflect(np.array([nodes + 1]), mirror, -walls[mirror])  # a rotation is an axial vector
    if plate is not None:
        body.root[plate], body.sign[plate], body.fixed[plate] = body.root[nodes], body.sign[nodes], body.fixed[nodes]
    numbering = body.numbering(0 if plate is None else 1 if pivot is None else 2)
    if plate is None or pivot is None:
        return numbering
    size, arms = float(np.ptp(mesh.points[:, 2])), mesh.points[plate] - pivot
    return replace(numbering, rotation=PlateRotation.of(plate, arms, size, *body.rotation(numbering)))


class _Dofs:
    """Constraints of the degrees of freedom (N, 3) of the nodes. Each one may be fixed, or equal plus or minus another
    one.
    """

    def __init__(self, fixed: np.ndarray, corners: int) -> None:
        self.root = np.arange(3 * len(fixed)).reshape(-1, 3)
        self.sign = np.ones((len(fixed), 3))
        self.fixed = np.repeat(fixed[:, None], 3, axis=1)
        self.no_pressure = np.zeros(corners, dtype=bool)

    def reflect(self, nodes: np.ndarray, mirror: Mirror, sign: int) -> None:
        """Constrain displacement and pressure at nodes on a mirror: ``sign`` is 1 for symmetric states, -1 for
        antisymmetric ones, 0 for any states without pressure."""
        if sign <= 0:
            self.no_pressure[nodes[nodes < len(self.no_pressure)]] = True
        if sign == 0:
            return
        diagonal = -mirror.normal[0] * mirror.normal[1]
        if diagonal:
            tie = sign * diagonal  # u_y = tie * u_x
            is_tied = self.root[nodes, 1] == self.root[nodes, 0]
            clash = nodes[is_tied & (self.sign[nodes, 1] != tie)]
            self.fixed[clash, :2] = True
            self.root[nodes, 1], self.sign[nodes, 1] = self.root[nodes, 0], tie
            fixed_either = self.fixed[nodes, 0] | self.fixed[nodes, 1]
            self.fixed[nodes, 0] = self.fixed[nodes, 1] = fixed_either
        else:
            normal = 0 if mirror.normal[0] else 1
            self.fixed[nodes, normal if sign > 0 else 1 - normal] = True
        if sign < 0:
            self.fixed[nodes, 2] = True

    def numbering(self, added: int) -> Numbering:
        """Number the free degrees of freedom, then the pressures. The last two nodes stand for the plate and its
        rotation; ``added`` of them, 0 to 2, exist.
        """
        present = slice(len(self.root) - 2 + added)
        used = np.zeros(self.root.size, dtype=bool)
        used[self.root[present][~self.fixed[present]]] = True
        number = np.where(used, np.cumsum(used) - 1, -1)
        unknown = np.where(self.fixed, -1, number[self.root])
        displacements, pressures = int(used.sum()), int((~self.no_pressure).sum())
        pressure = np.where(self.no_pressure, -1, displacements + np.cumsum(~self.no_pressure) - 1)
        return Numbering(
            np.concatenate([unknown[:-2].ravel(), pressure]),
            np.concatenate([self.sign[:-2].ravel(), np.ones(len(pressure))]),
            len(self.root) - 2,
            displacements,
            pressures,
            unknown[-2] if added else None,
            self.sign[-2] if added else None,
        )

    def rotation(self, numbering: Numbering) -> tuple[np.ndarray, np.ndarray]:
        """For each component of the plate's rotation: its unknown (-1 where it is 0), and its factor."""
        roots, fixed = self.root[-1] - 3 * (len(self.root) - 1), self.fixed[-1]
        free = np.unique(roots[~fixed])
        first = numbering.displacements - len(free)  # they are the last displacements
        return np.where(fixed, -1, first + np.searchsorted(free, roots)), self.sign[-1]
