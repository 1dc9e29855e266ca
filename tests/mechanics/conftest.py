"""Blocks with structured second-order meshes, and a cache of the tests' own."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.pads.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh


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


@pytest.fixture
def block():
    """A function that makes blocks."""
    return _block


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """An empty cache on disk and nothing in memory; call it to forget what memory holds."""
    from mitsuba_taxel.mechanics import path

    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "cache"))
    path._path.cache_clear()
    yield path._path.cache_clear
    path._path.cache_clear()
