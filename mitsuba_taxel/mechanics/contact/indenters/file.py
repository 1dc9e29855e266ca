"""A user's own body, from a file of triangles."""

from __future__ import annotations

import hashlib
import math
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.geometry.surfaces.cutaway import cut_open
from mitsuba_taxel.mechanics.contact.indenter_shape import Gap, IndenterShape
from mitsuba_taxel.mechanics.contact.indenters.punch import EDGE_FINENESS
from mitsuba_taxel.mechanics.contact.solid import Solid, content_of, solid_in
from mitsuba_taxel.pads.imported.placement import Placement


class File(IndenterShape, name="file", rank=4):
    """A body whose closed surface is read from a file. The tilt is applied when the file is read."""

    meaning = "a body from a file of triangles"
    uses = ("angle", "tilt", "file", "file_scale", "file_up")
    unbounded = False
    contact_grows = False
    finer_when_shallow = True

    def check(self) -> None:
        """Refuse a file without a closed surface; raises `InputError`."""
        _ = self.solid

    def digest(self) -> str:
        return hashlib.sha256(content_of(self.indenter.file)).hexdigest()

    @property
    def solid(self) -> Solid:
        """The tilted body of the file."""
        return solid_in(self.indenter.file, self.indenter.digest, self.indenter.tilt, self._placement)

    @property
    def _placement(self) -> Placement:
        return Placement(self.indenter.file_scale, self.indenter.file_up, "indenter_")

    @cached_property
    def turn(self) -> np.ndarray:
        """Matrix (3, 3) that turns the tilted body about z."""
        return Rotation.from_euler("ZY", [self.indenter.angle, 0.0], degrees=True).as_matrix()

    def own_gap(self, points: np.ndarray) -> Gap:
        return Gap(*self.solid.distance.at(points))

    def keeps(self, mirror: Mirror) -> bool:
        """Whether the body is symmetric in a mirror: the mirror image of its surface lies on its surface."""
        return self._keeps_tip(mirror) and self.solid.distance.keeps(self.turn.T @ mirror.image(np.eye(3)) @ self.turn)

    def contact_radius(self, depth: float) -> float:
        """Half the width of the contact: the radius of the circle with the area of the contact at the depth."""
        distance = self.solid.distance
        return distance.spacing * math.sqrt(len(distance.footprint(depth)) / (2 * math.pi))

    def pressure_length(self, depth: float) -> float:
        radius = self.contact_radius(depth)
        return EDGE_FINENESS * radius if len(self.solid.distance.walls(depth)) else radius

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Distances of points, in mm, from the edges of the contact area at steep walls of the body, such as those of a
        slot or a flat end. Without such walls, the pressure may be steep anywhere in the contact area: distances are
        those from all of it.
        """
        footprint = self.solid.distance.footprint(depth)
        if not len(footprint):
            size = np.ptp(self.solid.vertices, axis=0)
            raise InputError(
                f"{self.size_text} is not allowed: {' x '.join(f'{side:.3g}' for side in size)} mm is too small a body "
                f"for a depth of {depth:.3g} mm{self._placement.other_units(float(size.max()))}."
            )
        if len(walls := self.solid.distance.walls(depth)):
            footprint = walls
        level = PointTree(np.append(footprint, np.zeros((len(footprint), 1)), axis=1))
        return level.query(points)[0]

    @property
    def thickness(self) -> float:
        return float(np.ptp(self.solid.vertices, axis=0).min())

    @property
    def size_text(self) -> str:
        return f"indenter_file = {self.indenter.file}"

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        low = cut_open(self.solid.vertices, self.solid.triangles, np.array([0.0, 0.0, -1.0]), -reach)
        return low.vertices, low.triangles
