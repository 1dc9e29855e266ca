"""Base class of the kinds of rigid indenters."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.geometry.mirror import Mirror

TINY = np.finfo(float).tiny


class Gap(NamedTuple):
    """Signed distances of n points from an indenter, negative inside.

    Attributes
    ----------
    size : (n,) ndarray
        Signed distances in mm.
    normal : (n, 3) ndarray
        Gradient of each distance: a unit vector that points out of the indenter.
    curvature : (n, 3, 3) ndarray
        Second derivatives of each distance, 1/mm.
    """

    size: np.ndarray
    normal: np.ndarray
    curvature: np.ndarray


class IndenterShape(Kind, family="indenter"):
    """A kind of rigid body that presses on a pad from above, with its dimensions.

    Lengths are in mm. Points are relative to the tip, which is the lowest point of the body or, if the body is
    unbounded, any of its points. A new kind is a subclass with a ``name`` in a module of
    ``mitsuba_taxel.mechanics.contact.indenters``, or in a script; it must define all abstract members. Methods whose
    names begin with ``own_`` refer to the frame of the body, neither turned nor tilted.

    Parameters
    ----------
    indenter : Indenter
        Its dimensions, position and direction.

    Attributes
    ----------
    unbounded : bool
        Whether the body covers a pad wherever it is placed. Such a body has no position and no edge of contact, and
        first touches a pad at a node.
    contact_grows : bool
        Whether the contact begins as a point or a line, and grows with the depth; otherwise it begins as a face.
    finer_when_shallow : bool
        Whether smaller elements under the tip can resolve a small contact.
    """

    prefix = "indenter_"

    unbounded: ClassVar[bool]
    contact_grows: ClassVar[bool]
    finer_when_shallow: ClassVar[bool]

    def __init__(self, indenter: Any) -> None:
        self.indenter = indenter

    def check(self) -> None:
        """Refuse parameters that contradict each other.

        Raises
        ------
        InputError
            if parameters contradict each other.
        """

    def digest(self) -> str:
        """Digest of data on which the body depends in addition to its parameters, such as the content of a file.

        Returns
        -------
        str
            Digest; empty if the body depends on nothing else.
        """
        return ""

    @abstractmethod
    def own_gap(self, points: np.ndarray) -> Gap:
        """Distances of points from the body.

        Parameters
        ----------
        points : (n, 3) ndarray
            In the body's own frame, mm.

        Returns
        -------
        Gap
            Distances, normals and curvatures.
        """

    def gap(self, points: np.ndarray) -> Gap:
        """Distances of points from the rotated body.

        Parameters
        ----------
        points : (n, 3) ndarray
            Positions relative to the tip, mm.

        Returns
        -------
        Gap
            Distances, normals and curvatures.
        """
        if not (self.indenter.angle or self.indenter.tilt):
            return self.own_gap(points)
        size, normal, curvature = self.own_gap(self._in_own_frame(points))
        return Gap(size, normal @ self.turn.T, self.turn @ curvature @ self.turn.T)

    @abstractmethod
    def keeps(self, mirror: Mirror) -> bool:
        """Whether the body, at its start position, is symmetric about a plane of symmetry (mirror) of the pad.

        Parameters
        ----------
        mirror : Mirror
            A plane of symmetry of the pad.

        Returns
        -------
        bool
            True if the body is its own mirror image.
        """

    def highest(self, points: np.ndarray) -> int:
        """Index of the point of the pad above which the body starts; by default, the highest point.

        Parameters
        ----------
        points : (n, 3) ndarray
            Points of the pad, mm.

        Returns
        -------
        int
            Row of the point.
        """
        return int(points[:, 2].argmax())

    def start(self, highest: np.ndarray) -> np.ndarray:
        """Start position of the tip.

        Parameters
        ----------
        highest : (3,) ndarray
            The point of :meth:`highest`, mm.

        Returns
        -------
        (3,) ndarray
            Position in the frame of the pad, mm.
        """
        return np.array([*self.indenter.at, highest[2]])

    @abstractmethod
    def contact_radius(self, depth: float) -> float:
        """Half the width of the contact with a half-space.

        Beyond a largest depth it is constant, so that elements under a deeper body stay as small as at that depth.

        Parameters
        ----------
        depth : float
            Depth of the tip below the undeformed surface, mm.

        Returns
        -------
        float
            Half the width in mm; infinite for an unbounded body.
        """

    def pressure_length(self, depth: float) -> float:
        """Length in mm over which the contact pressure changes where its gradient is largest.

        Parameters
        ----------
        depth : float
            Depth of the tip below the undeformed surface, mm.

        Returns
        -------
        float
            Length in mm: half the width of the contact, unless the pressure is concentrated at an edge.
        """
        return self.contact_radius(depth)

    @abstractmethod
    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Distances of points from the places on the contact where the contact pressure changes most steeply, for a
        body that is neither turned nor tilted. Elements are refined there.

        Parameters
        ----------
        points : (n, 3) ndarray
            In the body's own frame, mm.
        depth : float
            Depth of the tip below the undeformed surface, mm.

        Returns
        -------
        (n,) ndarray
            Distances in mm.

        Raises
        ------
        InputError
            if the body is too small for the depth.
        """

    def distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Distances of points from the places on the contact where the contact pressure changes most steeply, for the
        turned and tilted body. Elements are refined there.

        Parameters
        ----------
        points : (n, 3) ndarray
            Positions relative to the tip, mm.
        depth : float
            Depth of the tip below the undeformed surface, mm.

        Returns
        -------
        (n,) ndarray
            Distances in mm.

        Raises
        ------
        InputError
            if the body is too small for the depth.
        """
        return self.own_distance_to_steepest_pressure(self._in_own_frame(points), depth)

    @property
    @abstractmethod
    def thickness(self) -> float:
        """Smallest thickness in mm; infinite if the body extends upwards without limit."""

    @property
    @abstractmethod
    def size_text(self) -> str:
        """The parameter that determines the size of the body, with its value, as text for messages, such as
        "indenter_radius = 2".
        """

    @abstractmethod
    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """A closed surface of triangles: the body near its tip, for drawings.

        Parameters
        ----------
        reach : float
            Distance from the tip in each direction up to which the body is drawn, mm.

        Returns
        -------
        vertices : (V, 3) ndarray
            In the body's own frame, mm.
        triangles : (T, 3) ndarray of int
            Rows of their vertices, counter-clockwise from outside.
        """

    def surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """A closed surface of triangles of the rotated body near its tip, for drawings.

        Parameters
        ----------
        reach : float
            Distance from the tip in each direction up to which the body is drawn, mm.

        Returns
        -------
        vertices : (V, 3) ndarray
            Positions relative to the tip, mm.
        triangles : (T, 3) ndarray of int
            Rows of their vertices, counter-clockwise from outside.
        """
        vertices, triangles = self.own_surface(reach)
        return vertices @ self.turn.T + [0.0, 0.0, self.lift], triangles

    @cached_property
    def turn(self) -> np.ndarray:
        """Rotation (3, 3) of the body: first by its tilt about y, then by its angle about z."""
        angles = [self.indenter.angle or 0.0, self.indenter.tilt or 0.0]
        return Rotation.from_euler("ZY", angles, degrees=True).as_matrix()

    @property
    def lift(self) -> float:
        """Height in mm by which the tilted body is raised, so that its lowest point is at the height of the tip."""
        return 0.0

    @property
    def up(self) -> np.ndarray:
        """Unit vector (3,) along the axis of the body."""
        return self.turn[:, 2]

    def _in_own_frame(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) in the body's own frame."""
        return (points - [0.0, 0.0, self.lift]) @ self.turn

    def _keeps_axis(self, mirror: Mirror) -> bool:
        """Whether a mirror leaves the direction of the body's axis unchanged."""
        up = np.round(self.up, 12)
        return bool(np.array_equal(mirror.image(up), up))

    def _keeps_tip(self, mirror: Mirror) -> bool:
        """Whether a mirror leaves the position of the tip unchanged."""
        tip = np.array([*self.indenter.at, 0.0])
        return bool(np.array_equal(mirror.image(tip), tip))


class RoundBody(IndenterShape):
    """A body of one radius: common base class of a ball and a rod that lies on the pad.

    Attributes
    ----------
    across : (3, 3) ndarray
        Projection along the axis of a rod; the identity for a ball.
    deepest : float
        Depth, relative to the radius, beyond which :meth:`contact_radius` is constant.
    """

    unbounded = False
    contact_grows = True
    finer_when_shallow = True

    across: ClassVar[np.ndarray]
    deepest: ClassVar[float]

    def own_gap(self, points: np.ndarray) -> Gap:
        radius, projected = self.indenter.radius, points @ self.across
        from_centre = projected - [0.0, 0.0, radius]
        distance = np.maximum(np.linalg.norm(from_centre, axis=1), TINY)
        normal = from_centre / distance[:, None]
        curvature = (self.across - normal[:, :, None] * normal[:, None, :]) / distance[:, None, None]
        # avoids cancellation of two radii far larger than the gap
        size = ((projected**2).sum(axis=1) - 2 * radius * points[:, 2]) / (distance + radius)
        return Gap(size, normal, curvature)

    def contact_radius(self, depth: float) -> float:
        """Half the width of the contact in mm at a ``depth`` in mm, by Hertz's theory for a ball. A rod gets the same
        value: for a rod on a half-space, Hertz's theory has no finite depth.
        """
        radius = self.indenter.radius
        return math.sqrt(radius * min(depth, self.deepest * radius))

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        return np.linalg.norm(points @ self.across, axis=1)

    @property
    def thickness(self) -> float:
        return 2 * self.indenter.radius

    @property
    def size_text(self) -> str:
        return f"indenter_radius = {self.indenter.radius:g}"


ALONG = 33
"""Points along the outline of a round body in drawings."""


def round_outline(radius: float, reach: float) -> np.ndarray:
    """Half the outline of a circle that stands on its lowest point.

    Parameters
    ----------
    radius : float
        Radius of the circle, mm.
    reach : float
        Largest distance from the axis, and largest height, mm.

    Returns
    -------
    (n, 2) ndarray
        Distance from the axis and height of each point, mm, from the lowest point upwards.
    """
    if 2 * radius <= reach:
        largest_angle = math.pi
    else:
        largest_angle = math.acos(1 - reach / radius) if radius < reach else math.asin(reach / radius)
    angles = np.linspace(0, largest_angle, ALONG)
    return radius * np.stack([np.sin(angles), 1 - np.cos(angles)], axis=1)
