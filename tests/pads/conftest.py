"""Surfaces of pads as files."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, VolumeMesh


def _write_stl(path, corners):
    rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = corners
    path.write_bytes(bytes(80) + len(rows).to_bytes(4, "little") + rows.tobytes())
    return path


def _facets(mesh: VolumeMesh, cuts: int) -> np.ndarray:
    """Corners (cuts² B, 3, 3) of flat triangles on a grid on each of the curved faces."""
    grid = {(i, j): (1 - (i + j) / cuts, i / cuts, j / cuts) for i in range(cuts + 1) for j in range(cuts + 1 - i)}
    number = {key: k for k, key in enumerate(grid)}
    b = np.array(list(grid.values()))
    shape = np.concatenate([b * (2 * b - 1), np.stack([4 * b[:, i] * b[:, j] for i, j in FACE_EDGES], axis=1)], axis=1)
    up = [[number[i, j], number[i + 1, j], number[i, j + 1]] for i, j in grid if i + j < cuts]
    down = [[number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]] for i, j in grid if i + j < cuts - 1]
    return (shape @ mesh.points[mesh.faces])[:, np.array(up + down)].reshape(-1, 3, 3)


@pytest.fixture(scope="session")
def facets():
    """A function that gives triangles (T, 3, 3) on the curved surface of a mesh, cut as fine as asked."""
    return _facets


@pytest.fixture(scope="session")
def write_stl():
    """A function that writes triangles (T, 3, 3) as a binary STL file and gives its path."""
    return _write_stl


@pytest.fixture(scope="session")
def pad_stl(tmp_path_factory):
    """A function that writes the surface of a mesh as an STL file."""

    def write(mesh: VolumeMesh, cuts: int):
        return _write_stl(tmp_path_factory.mktemp("stl") / "pad.stl", _facets(mesh, cuts))

    return write


BOX_CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
_BOX = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2)]
_BOX += [(1, 3, 7), (1, 7, 5)]


def _box(size=(4.0, 4.0, 3.0), hollow=(2.0, 2.0, 1.0)) -> np.ndarray:
    """Triangles (28, 3, 3) of a block on z = 0 with one hollow in the middle, open towards the board."""
    outer, inner = BOX_CORNERS * np.divide(size, (2, 2, 1)), BOX_CORNERS * np.divide(hollow, (2, 2, 1))
    shapes = [outer[list(t)] for t in _BOX[2:]] + [inner[list(t)][::-1] for t in _BOX[2:]]
    ring = [0, 1, 3, 2]
    for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
        shapes += [np.array([outer[a], inner[a], outer[b]]), np.array([outer[b], inner[a], inner[b]])]
    return np.array(shapes)


@pytest.fixture
def box():
    """A function that makes the triangles of a block with one hollow."""
    return _box
