"""Objects beside the pad in the viewer of a page: packages, LEDs, phototransistors, indenters, and light paths of a
cell."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mitsuba_taxel.kernels.protocols import is_pad
from mitsuba_taxel.report.page.coarsening import coarsened
from mitsuba_taxel.report.page.solids import ArrayEncoding
from mitsuba_taxel.report.picture.indenters import indenter_surface
from mitsuba_taxel.report.picture.rays import face_corners, shape_mesh
from mitsuba_taxel.sensing import sample_paths
from mitsuba_taxel.sensing.scene.taxels import taxels_of

SAMPLED, DRAWN = 200, 12
"""Numbers of sampled and of drawn light paths; the shortest paths that reach the phototransistor and the shortest other
paths are drawn."""
LIFT = 0.01
"""Height in mm by which faces are drawn above their package."""


class LitScene:
    """A loaded scene with light paths of one taxel, for the viewer of a page: the taxel nearest to the middle of
    ``box``, corners (2, 3) in mm.
    """

    def __init__(self, live: Any, box: np.ndarray) -> None:
        self._live, self._box, self._pairs = live, box, taxels_of(live)
        centres = np.concatenate([np.array(pair.sensor.faces.centres).T for pair in self._pairs])
        self.taxel = 1 + int(np.argmin(np.linalg.norm(centres - box.mean(axis=0), axis=1)))
        self.y = float(centres[self.taxel - 1, 1])

    def paths(self, packing: ArrayEncoding) -> dict[str, list[str]]:
        """Packed light paths: first those that reach the phototransistor, then others."""
        paths = sample_paths(self._live, self.taxel, count=SAMPLED)
        kinds: dict[str, list[np.ndarray]] = {"reached": [], "others": []}
        for vertices, reached in zip(paths.vertices, paths.reached, strict=True):
            kinds["reached" if reached else "others"].append(vertices)
        return {kind: [packing.lengths(path) for path in sorted(some, key=len)[:DRAWN]] for kind, some in kinds.items()}

    def fixed(self, packing: ArrayEncoding) -> list[dict[str, Any]]:
        """Packed solids other than pads, each with its kind and its largest y coordinate; boards are cut off near the
        pad."""
        margin = 0.04 * np.ptp(self._box, axis=0).max()
        solids = []
        for kind, vertices, triangles in self._parts():
            inside = np.clip(vertices, self._box[0] - margin, self._box[1] + margin)
            packed = {"vertices": packing.lengths(inside), "triangles": packing.indices(triangles)}
            solids.append({**packed, "kind": kind, "y": float(inside[:, 1].max())})
        return solids

    def indenters(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Vertices (V, 3) in mm and triangles (T, 3) of the indenters."""
        surfaces = (indenter_surface(shape) for shape in self._live.shapes() if is_pad(shape))
        return list(filter(None, surfaces))

    def _parts(self) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Kind, vertices and triangles of each connected surface of the scene."""
        for shape in self._live.shapes():
            mesh = None if is_pad(shape) else shape_mesh(shape)
            kind = "board" if shape.class_name() == "Rectangle" else "other"
            if mesh is None:
                continue
            mesh.merge_vertices()  # many files do not share vertices between triangles
            for body in mesh.split(only_watertight=False, repair=False):
                coarse = coarsened(body.vertices, body.faces, np.zeros(len(body.faces), dtype=np.int64))
                yield kind, body.vertices[coarse.kept], coarse.triangles
        for pair in self._pairs:
            for kind, faces in (("led", pair.led.window.faces), ("phototransistor", pair.sensor.window.faces)):
                for index in range(faces.count):
                    corners = face_corners(faces, index)
                    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                    yield kind, corners + LIFT * normal / np.linalg.norm(normal), np.array([[0, 1, 2], [0, 2, 3]])
