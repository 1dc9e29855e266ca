"""Rigid indenters as signed distances."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.point_tree import PointTree
from mitsuba_taxel.mechanics.contact.solid import Solid, content_of, solid_in
from mitsuba_taxel.pads.imported.placement import AS_DRAWN, DIRECTIONS, Placement
from mitsuba_taxel.parameters import REQUIRED, Checked, choice, number, text

INDENTERS = {
    "sphere": "a ball",
    "punch": "the flat end of a round rod, with a rounded edge",
    "cylinder": "a rod that lies on the pad, as long as it takes",
    "plane": "a plate as large as it takes",
    "file": "a body of one's own",
}
TINY = np.finfo(float).tiny
STEEPEST = 80.0
"""Largest tilt in degrees."""
DEEP = {"sphere": 0.25, "cylinder": 1.0}
"""Largest depth, relative to the radius, for which elements are as small as its contact needs."""
EDGE = 0.1
"""Default radius of a punch's edge, relative to that of the punch."""


class Gap(NamedTuple):
    """Signed distances from an indenter, negative inside.

    Attributes
    ----------
    size : (n,) ndarray
        In mm.
    normal : (n, 3) ndarray
        Gradient: unit vector out of the indenter.
    curvature : (n, 3, 3) ndarray
        Second derivatives, 1/mm.
    """

    size: np.ndarray
    normal: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True)
class Indenter(Checked):
    """A rigid indenter above the pad, whose tip starts at the height of the pad's highest point.

    Raises
    ------
    InputError
        if a value is not finite or out of range, or a file holds no closed surface.
    """

    shape: str = choice("sphere", INDENTERS, "What presses on the pad.", name="indenter")
    radius: float | None = number(
        REQUIRED,
        "mm",
        "Radius of the ball, of the rod.",
        above=0,
        common=(0.02, 500),
        when=("shape", "sphere", "punch", "cylinder"),
        name="indenter_radius",
    )
    at: Sequence[float] = (0.0, 0.0)
    angle: float | None = number(
        0.0,
        "degrees",
        "About z, from x to the axis of a cylinder, or to that of the file, and to where what is tilted leans.",
        when=("shape", "punch", "cylinder", "plane", "file"),
        name="indenter_angle",
    )
    tilt: float | None = number(
        0.0,
        "degrees",
        "By which the body leans from upright, about the middle of the end of a punch, or x = y = 0 of a file at its "
        "lowest height; its lowest point is the tip then. A plate starts where it touches the pad.",
        minimum=-STEEPEST,
        maximum=STEEPEST,
        when=("shape", "punch", "plane", "file"),
        name="indenter_tilt",
    )
    edge_radius: float | None = number(
        None,
        "mm",
        "Of the rounded edge of a punch, at most its radius.",
        above=0,
        common=(0.002, 500),
        when=("shape", "punch"),
        name="indenter_edge_radius",
        default_words="a tenth of its radius",
    )
    friction: float = number(0.0, "", "Coefficient of Coulomb's friction.", minimum=0, common=(0, 2))
    file: str | None = text(
        REQUIRED,
        "A closed surface as STL, PLY or OBJ, in mm. Its lowest point is as high as a tip, and its place x = y = 0 is "
        "where the indenter is placed; edges are rounded by a fiftieth of its longest side.",
        "the name of a file",
        when=("shape", "file"),
        name="indenter_file",
    )
    file_scale: float | None = number(
        1.0,
        "",
        "Mm per unit of length of the file: 25.4 for inches, 1000 for m.",
        above=0,
        when=("shape", "file"),
        name="indenter_file_scale",
    )
    file_up: str | None = choice(
        AS_DRAWN,
        DIRECTIONS,
        "Direction in the file that points up. With one, the middle of the box around the body is where the indenter "
        "is placed.",
        when=("shape", "file"),
        name="indenter_file_up",
    )
    digest: str = field(default="", init=False, repr=False)

    def __post_init__(self) -> None:
        if self.file is not None:
            object.__setattr__(self, "file", str(self.file))
            if self.shape == "sphere":
                object.__setattr__(self, "shape", "file")
        super().__post_init__()

    def _check(self) -> None:
        try:
            x, y = (float(place) for place in self.at)
        except (TypeError, ValueError, OverflowError):
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InputError(f"indenter at = {self.at!r} is not allowed: two finite numbers are needed.")
        object.__setattr__(self, "at", (x, y))
        if self.edge_radius is not None and self.edge_radius > self._radius:
            raise InputError(
                f"indenter_edge_radius = {self.edge_radius:g} is not allowed: at most indenter_radius = "
                f"{self._radius:g} is needed."
            )

        if self.file is not None:
            object.__setattr__(self, "digest", hashlib.sha256(content_of(self.file)).hexdigest())
            _ = self.solid  # refuses one that holds none

    @property
    def solid(self) -> Solid:
        """What the file holds, tilted."""
        assert self.file is not None
        return solid_in(self.file, self.digest, self.tilt or 0.0, self._placement)

    @property
    def _placement(self) -> Placement:
        assert self.file_scale is not None and self.file_up is not None
        return Placement(self.file_scale, self.file_up, "indenter_")

    def gap(self, places: np.ndarray) -> Gap:
        """Distances of places (n, 3), in mm from the tip."""
        if not (self.angle or self.tilt):
            return self._own_gap(places)
        size, normal, curvature = self._own_gap(self._own(places))
        return Gap(size, normal @ self.turn.T, self.turn @ curvature @ self.turn.T)

    def _own(self, places: np.ndarray) -> np.ndarray:
        """Places (n, 3) as seen from the body."""
        return (places - [0.0, 0.0, self.lift]) @ self.turn

    def _own_gap(self, places: np.ndarray) -> Gap:
        """As :meth:`gap`, of the body neither turned nor tilted."""
        if self.shape == "file":
            return Gap(*self.solid.distance.at(places))
        if self.shape == "plane":
            down = np.broadcast_to([0.0, 0.0, -1.0], places.shape)
            return Gap(-places[:, 2], down, np.zeros((len(places), 3, 3)))
        if self.shape == "punch":
            return self._of_punch(places)
        free = np.diag([0.0 if self.shape == "cylinder" else 1.0, 1.0, 1.0])
        across = places @ free
        from_middle = across - [0.0, 0.0, self._radius]
        distance = np.maximum(np.linalg.norm(from_middle, axis=1), TINY)
        normal = from_middle / distance[:, None]
        curvature = (free - normal[:, :, None] * normal[:, None, :]) / distance[:, None, None]
        # avoids cancellation of two radii far larger than the gap
        gap = ((across**2).sum(axis=1) - 2 * self._radius * places[:, 2]) / (distance + self._radius)
        return Gap(gap, normal, curvature)

    def _of_punch(self, places: np.ndarray) -> Gap:
        """A rod with a flat end: a core that is thinner by the edge's radius, offset by that radius."""
        edge = self.edge
        across = np.maximum(np.hypot(places[:, 0], places[:, 1]), TINY)
        outwards = places * [1.0, 1.0, 0.0] / across[:, None]
        around = outwards @ [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        beyond, below = across - (self._radius - edge), edge - places[:, 2]
        sideways, downwards = np.maximum(beyond, 0.0), np.maximum(below, 0.0)
        distance = np.hypot(sideways, downwards)
        inside = distance == 0  # the core, where the nearer of end and side counts
        distance = np.where(inside, np.maximum(beyond, below), distance)
        sideways = np.where(inside, beyond > below, sideways / np.where(inside, 1.0, distance))
        downwards = np.where(inside, beyond <= below, downwards / np.where(inside, 1.0, distance))
        down = np.array([0.0, 0.0, -1.0])
        normal = sideways[:, None] * outwards + downwards[:, None] * down
        along = downwards[:, None] * outwards - sideways[:, None] * down
        rounded = (sideways > 0) & (downwards > 0)
        bends = np.where(rounded, 1 / np.where(rounded, distance, 1.0), 0.0), sideways / across
        curvature = sum(
            bend[:, None, None] * way[:, :, None] * way[:, None, :]
            for bend, way in zip(bends, (along, around), strict=True)
        )
        return Gap(distance - edge, normal, curvature)

    @property
    def _radius(self) -> float:
        assert self.radius is not None
        return self.radius

    @property
    def edge(self) -> float:
        """Mm, radius of the edge of a punch."""
        return EDGE * self._radius if self.edge_radius is None else self.edge_radius

    def keeps(self, mirror: Mirror) -> bool:
        """Whether the indenter at its start is symmetric in a mirror."""
        if self.shape == "file":
            return False
        here, up = np.array([*self.at, 0.0]), np.round(self._up, 12)
        if not np.array_equal(mirror.image(up), up):
            return False
        if self.shape == "plane":
            return True
        if self.shape == "cylinder":
            axis = np.round(self.turn[:, 0], 12)
            image, across = mirror.image(axis), np.array([-axis[1], axis[0], 0.0])
            turned = not np.array_equal(image, axis) and not np.array_equal(image, -axis)
            return not turned and across @ mirror.image(here) == across @ here
        return bool(np.array_equal(mirror.image(here), here))

    def highest(self, points: np.ndarray) -> int:
        """The number of that of the points (n, 3) of a pad which determines where the body starts."""
        return int((points @ self._up).argmax() if self.shape == "plane" else points[:, 2].argmax())

    def start(self, highest: np.ndarray) -> np.ndarray:
        """(3,) mm where the tip starts, or any point of a plate, from the point (3,) that :meth:`highest` finds."""
        if self.shape == "plane":
            return np.array([0.0, 0.0, highest @ self._up / self._up[2]])
        return np.array([*self.at, highest[2]])

    def from_contact(self, places: np.ndarray, depth: float) -> np.ndarray:
        """(n,) mm from places (n, 3), relative to the tip, to where the pressure at a depth in mm changes most."""
        places = self._own(places)
        if self.shape == "file":
            footprint = self.solid.distance.footprint(depth)
            if not len(footprint):
                size = np.ptp(self.solid.vertices, axis=0)
                raise InputError(
                    f"indenter_file = {self.file} is not allowed: {' x '.join(f'{side:.3g}' for side in size)} mm is "
                    f"too small a body for a depth of {depth:.3g} mm{self._placement.other_units(float(size.max()))}."
                )
            level = PointTree(np.append(footprint, np.zeros((len(footprint), 1)), axis=1))
            return level.query(places)[0]
        if self.shape == "cylinder":
            return np.hypot(places[:, 1], places[:, 2])
        if self.shape == "punch":
            return np.hypot(np.hypot(places[:, 0], places[:, 1]) - self._radius, places[:, 2])
        return np.linalg.norm(places, axis=1)

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) matrix that turns a body: it leans, unless its file is read so, and then turns about z."""
        tilt = 0.0 if self.shape == "file" else self.tilt or 0.0
        return Rotation.from_euler("ZY", [self.angle or 0.0, tilt], degrees=True).as_matrix()

    @property
    def lift(self) -> float:
        """Mm by which the lowest point of a tilted punch would be too low."""
        if self.shape != "punch":
            return 0.0
        tilt = math.radians(abs(self.tilt or 0.0))
        return (self._radius - self.edge) * math.sin(tilt) + self.edge * (1 - math.cos(tilt))

    @property
    def _up(self) -> np.ndarray:
        """(3,) unit vector along the axis of what is not a file."""
        return self.turn[:, 2]

    @property
    def thickness(self) -> float:
        """Mm, where the body is thinnest; infinite for a punch and a plate."""
        if self.shape == "file":
            return float(np.ptp(self.solid.vertices, axis=0).min())
        return math.inf if self.shape in ("punch", "plane") else 2 * self._radius

    def contact_radius(self, depth: float) -> float:
        """Half the width in mm of the contact with a half-space at a depth in mm, by Hertz; infinite for a plane."""
        if self.shape == "plane":
            return math.inf
        if self.shape == "file":  # as of the ball that is as wide there
            distance = self.solid.distance
            return distance.spacing * math.sqrt(len(distance.footprint(depth)) / (2 * math.pi))
        if self.shape == "punch":
            return self._radius
        return math.sqrt(self._radius * min(depth, DEEP[self.shape] * self._radius))
