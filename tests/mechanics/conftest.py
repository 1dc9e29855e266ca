"""Structured second-order meshes, equilibria under any boundary conditions, and a cache of the tests' own."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.geometry.mirror import ACROSS_X, ACROSS_Y, mirrored
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES, TET_FACES, VolumeMesh
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import Numbering, number_unknowns
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces, pressure_stiffness
from mitsuba_taxel.mechanics.elements.solvers import make_solver
from mitsuba_taxel.pads import REGIONS


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory):
    """Keep the solutions of all tests of this session away from the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path_factory.mktemp("solutions")))
        yield


def _block(size=(1.0, 1.0, 1.0), cells=(2, 2, 2), distortion=0.0, curvature=0.0, seed=0) -> VolumeMesh:
    """Block [0, size] of six tetrahedra per cell.

    Inner corners are moved by up to ``distortion`` of a cell's size, inner mid-edge nodes by ``curvature``.
    """
    rng = np.random.default_rng(seed)
    shape = np.array(cells) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
    tets = []
    for origin in itertools.product(*(range(n) for n in cells)):
        for axes in itertools.permutations(range(3)):
            steps = np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(axes)]], axis=0) + origin
            if np.linalg.det(np.diff(steps, axis=0)) < 0:
                steps[[1, 2]] = steps[[2, 1]]
            tets.append(np.ravel_multi_index(steps.T, shape))
    tets = np.array(tets)
    points = grid / cells * size
    inner = np.all((grid > 0) & (grid < cells), axis=1)
    cell = np.array(size) / cells
    points[inner] += distortion * cell * rng.uniform(-1, 1, (np.count_nonzero(inner), 3))

    ends = np.sort(tets[:, np.array(TET_EDGES)], axis=2)
    edges, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    middle = points[edges].mean(axis=1)
    middle_inner = np.all((middle > 1e-9) & (middle < np.array(size) - 1e-9), axis=1)
    middle[middle_inner] += curvature * cell * rng.uniform(-1, 1, (np.count_nonzero(middle_inner), 3))
    tets = np.concatenate([tets, len(points) + number.reshape(len(tets), 6)], axis=1)
    points = np.concatenate([points, middle])
    faces, region = _boundary(points, tets, size)
    return VolumeMesh(points, tets, faces, region, np.zeros(len(faces), int))


def _boundary(points, tets, size):
    """Faces on the block's sides and their regions."""
    edge_number = {frozenset(edge): 4 + k for k, edge in enumerate(TET_EDGES)}
    faces, region = [], []
    for corners in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)):
        edges = [edge_number[frozenset((corners[i], corners[j]))] for i, j in FACE_EDGES]
        nodes = tets[:, [*corners, *edges]]
        for axis, end in itertools.product(range(3), (0, 1)):
            on = np.all(np.abs(points[nodes[:, :3], axis] - end * size[axis]) < 1e-9, axis=1)
            faces.append(nodes[on])
            name = "outer" if axis < 2 else ("bottom", "top")[end]
            region.append(np.full(np.count_nonzero(on), REGIONS[name]))
    return np.concatenate(faces), np.concatenate(region)


def _symmetric_block(size=(1.0, 1.0, 1.0), cells=(2, 2, 2)) -> VolumeMesh:
    """Block on the board, its centre at x = y = 0, that mirrors in both planes map on itself, and in the diagonals if
    it is square; ``cells`` are those of a quarter."""
    return _completed(_block((size[0] / 2, size[1] / 2, size[2]), cells))


def _completed(quarter: VolumeMesh) -> VolumeMesh:
    """A quarter at x, y >= 0 with its images in both planes; of its nodes, those that elements have."""
    kept = ~np.any(np.all(quarter.points[quarter.faces][:, :, :2] == 0, axis=1), axis=1)
    faces = {name: getattr(quarter, name)[kept] for name in ("faces", "face_region", "face_cell")}
    mesh = replace(quarter, **faces)
    for mirror in (ACROSS_X, ACROSS_Y):
        mesh = mirrored(mesh, mirror)
    corners, others = np.unique(mesh.tets[:, :4]), np.unique(mesh.tets[:, 4:])
    order = np.concatenate([corners, others])
    number = np.zeros(len(mesh.points), dtype=int)
    number[order] = np.arange(len(order))
    return replace(mesh, points=mesh.points[order], tets=number[mesh.tets], faces=number[mesh.faces])


def _thin_walled(pad, across, up) -> VolumeMesh:
    """A pad of one parallelepiped cell: its walls and roof are one hexahedron thick, of six tetrahedra each.

    A quarter has ``across`` of these along half of the cell, and ``up`` along its height.
    """
    half, top = pad.cell_size / 2, pad.top_of_cell
    mesh = _block((across + 1, across + 1, up + 1), (across + 1, across + 1, up + 1))
    lines = [np.append(np.linspace(0, half, across + 1), half + pad.wall)] * 2
    lines.append(np.append(np.linspace(0, top, up + 1), pad.height))
    points = np.stack([np.interp(mesh.points[:, k], np.arange(len(line)), line) for k, line in enumerate(lines)], 1)
    middle = points[mesh.tets[:, :4]].mean(axis=1)
    tets = mesh.tets[(middle[:, :2].max(axis=1) > half) | (middle[:, 2] > top)]
    faces = tets[:, np.array(TET_FACES)].reshape(-1, 6)
    _, first, count = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    faces = faces[first[count == 1]]
    x, y, z = np.moveaxis(points[faces], 2, 0)
    outer = (x == half + pad.wall).all(axis=1) | (y == half + pad.wall).all(axis=1)
    ends = [(z == height).all(axis=1) for height in (top, 0.0, pad.height)]
    codes = [REGIONS[name] for name in ("outer", "roof", "bottom", "top")]
    region = np.select([outer, *ends], codes, REGIONS["side"])
    cell = np.isin(region, [REGIONS["roof"], REGIONS["side"]]).astype(int)
    return _completed(VolumeMesh(points, tets, faces, region, cell))


@pytest.fixture
def block():
    """A function that makes blocks."""
    return _block


@pytest.fixture
def symmetric_block():
    """A function that makes symmetric blocks."""
    return _symmetric_block


@pytest.fixture
def thin_walled():
    """A function that makes meshes of thin-walled pads."""
    return _thin_walled


class Body:
    """A mesh with displacements prescribed component by component, solved as it stands, without a pad's board.

    Parameters
    ----------
    fixed : (N, 3) which displacements are prescribed
    ties : (nodes, one, other): components of the nodes that are equal, as u_x = u_z on a plane of symmetry x = z
    pressed : faces (B, 6) that a pressure follows
    """

    def __init__(self, mesh, law, fixed, ties=(), pressed=None) -> None:
        fixed, root = fixed.copy(), np.arange(3 * len(mesh.points)).reshape(-1, 3)
        for nodes, one, other in ties:  # in an order that lets a tie reach a component tied before
            fixed[nodes, other] = fixed[nodes, one] = fixed[nodes, one] | fixed[nodes, other]
            root[nodes, other] = root[nodes, one]
        used = np.unique(root[~fixed])
        unknown = np.where(fixed, -1, np.searchsorted(used, root)).ravel()
        pressures = len(used) + np.arange(mesh.corner_count)
        self.mesh, self.law, self.pressed, self.stress_update = mesh, law, pressed, None
        self.numbering = Numbering(
            np.concatenate([unknown, pressures]),
            np.ones(len(unknown) + len(pressures)),
            len(mesh.points),
            len(used),
            len(pressures),
        )
        self.assembly = Assembly(mesh, law, self.numbering)
        self._solver = make_solver()

    def step(self, displacement, pressure, load=0.0, pressing=0.0):
        """One step of Newton's method: the new state, and the largest out-of-balance force or volume before."""
        state = self.assembly.evaluate(displacement, pressure, stress_update=self.stress_update)
        residual, entries = state.residual - self._summed(load), state.entries
        if pressing:
            places = (self.mesh.points + displacement)[self.pressed]
            self.assembly.sparsity.add_blocks(entries, self.pressed, -pressing * pressure_stiffness(places))
            nodal = np.zeros_like(displacement)
            np.add.at(nodal, self.pressed, pressure_forces(places))
            residual = residual - pressing * self.numbering.summed(nodal)
        du, dp = self.numbering.split(self._solver.factor(self.assembly.matrix(entries)).solve(residual))
        return displacement - du, pressure - dp, np.abs(residual).max()

    def solve(self, displacement, pressure=None, load=0.0, pressing=0.0):
        """Displacement (N, 3) and pressure (corners,) in balance, from a start with the prescribed displacements."""
        pressure = np.zeros(self.mesh.corner_count) if pressure is None else pressure
        for _ in range(15):
            displacement, pressure, error = self.step(displacement, pressure, load, pressing)
            if error < 1e-10 * self.law.shear_modulus:
                return displacement, pressure
        raise AssertionError("Newton's method does not converge")

    def forces(self, displacement, pressure):
        """(N, 3) forces that hold each node."""
        free = Assembly(self.mesh, self.law, number_unknowns(self.mesh, np.zeros(len(self.mesh.points), bool)))
        residual = free.evaluate(displacement, pressure, with_tangent=False).residual
        return residual[: displacement.size].reshape(-1, 3)

    def _summed(self, load):
        return self.numbering.summed(np.broadcast_to(load, self.mesh.points.shape))


@pytest.fixture
def body():
    """The class of bodies with any prescribed displacements."""
    return Body


@pytest.fixture
def mapped():
    """A function that bends a mesh: points (N, 3) -> points (N, 3)."""
    return lambda mesh, bend: replace(mesh, points=bend(mesh.points))


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """An empty cache on disk and nothing in memory; call it to forget what memory holds."""
    from mitsuba_taxel.mechanics.continuation.pad_path import shared

    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "cache"))
    shared.cache_clear()
    yield shared.cache_clear
    shared.cache_clear()


@pytest.fixture
def few_elements_under_bodies(fresh, monkeypatch):
    """Meshes with larger elements under indenters, for tests of what holds on elements of any size."""
    from mitsuba_taxel.mechanics import local_mesh
    from mitsuba_taxel.mechanics.contact.indenters import punch

    # At the edge of a punch they stay as small as they are: a path needs them there.
    monkeypatch.setattr(punch, "EDGE_FINENESS", punch.EDGE_FINENESS * local_mesh.FINENESS / 1.3)
    monkeypatch.setattr(local_mesh, "FINENESS", 1.3)
    return fresh
