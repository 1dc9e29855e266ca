"""The deformed pads of a study, packed for the page's viewer."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.report.page.coarsening import CoarseSurface, coarsened

SPAN = 32000
"""Integer that encodes the largest length."""


class ShownSurface(NamedTuple):
    """The surface of a deformed pad for the viewer: vertices (N, 3) in mm, triangles (M, 3) and their regions (M,), and
    contact pressure (N,) in MPa.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    regions: np.ndarray
    pressure: np.ndarray


def read_surfaces(files: Sequence[Path]) -> ShownSurface:
    """Read the surfaces of PLY files, and join them to one surface."""
    surfaces = [_read(file) for file in files]
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces[:-1])])
    triangles = [surface.triangles + start for surface, start in zip(surfaces, starts, strict=True)]
    return ShownSurface(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate(triangles),
        np.concatenate([surface.regions for surface in surfaces]),
        np.concatenate([surface.pressure for surface in surfaces]),
    )


def _read(file: Path) -> ShownSurface:
    import trimesh

    mesh = trimesh.load_mesh(file, process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    raw = mesh.metadata["_ply_raw"]
    regions, vertices = raw["face"]["data"]["region_0"].astype(np.int64), raw["vertex"]["data"]
    pressed = "contact_pressure_0" in vertices.dtype.names
    pressure = vertices["contact_pressure_0"] if pressed else np.zeros(len(mesh.vertices))
    return ShownSurface(np.asarray(mesh.vertices), np.asarray(mesh.faces), regions, pressure.astype(float))


class Topologies:
    """The distinct triangulations in a panel of the viewer, each simplified once; surfaces with the same triangles
    share one.
    """

    def __init__(self) -> None:
        self._places: dict[bytes, int] = {}
        self.coarse: list[CoarseSurface] = []

    def place(self, surface: ShownSurface) -> int:
        """Index in ``coarse`` of the simplified triangulation of a surface, which is added if it is new."""
        key = surface.triangles.tobytes()
        if key not in self._places:
            self._places[key] = len(self.coarse)
            self.coarse.append(coarsened(surface.vertices, surface.triangles, surface.regions))
        return self._places[key]


class ArrayEncoding:
    """Encoding of arrays as base-64 text; lengths are 16-bit little-endian multiples of ``unit`` mm."""

    def __init__(self, largest: float) -> None:
        self.unit = max(largest, 1e-6) / SPAN

    def lengths(self, vertices: np.ndarray) -> str:
        """Encode lengths (..., 3) in mm."""
        return _text(np.round(np.clip(vertices / self.unit, -SPAN, SPAN)).astype("<i2"))

    @staticmethod
    def shares(values: np.ndarray, most: float) -> str:
        """Encode values (V,) as fractions of ``most``: bytes from 0 to 255, as text."""
        return _text(np.round(255 * np.clip(values / most, 0, 1)).astype(np.uint8))

    @staticmethod
    def indices(triangles: np.ndarray) -> str:
        """Encode indices (T, 3) of vertices, which must be below 65536."""
        return _text(triangles.astype("<u2"))

    def topology(self, coarse: CoarseSurface) -> Mapping[str, Any]:
        """Encode the triangles of a simplified surface and their regions."""
        return {"triangles": self.indices(coarse.triangles), "regions": _text(coarse.regions.astype(np.uint8))}


def _text(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
