"""Whether elements are small enough for the contact with an indenter.

Contact prevents penetration on average around each node only. Between nodes the body may penetrate the pad, and a body
that is smaller than an element may exert no force at all. Two figures measure this: the depth of the body inside the
deformed pad, relative to that in the undeformed pad, and the size of the faces under it, relative to half the width of
the contact. Within both limits, forces of balls on a block agree with those on much smaller elements to 8 %; beyond,
all of the force may be missing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.pads.regions import REGIONS

DEEPEST, DEEPEST_AT_EDGES = 0.25, 0.6
"""Largest depth of a body inside the deformed pad, relative to that in the undeformed pad; and the same for a body with
a flat end: at its edge the pad rises steeply between nodes, which hardly changes the force."""
LARGEST, LARGEST_IF_REFINABLE = 2.0, 1.5
"""Largest face under a body, relative to half the width of the contact, and the same while elements can still be made
smaller: between the two, forces of balls whose tip is between nodes are up to 25 % too small."""
SPACING = 0.25
"""Distance between tested points, relative to half the width of the contact."""
BENT = 1.2
"""Largest ratio of a length on a curved face to the distance between its corners."""
MOST_CUTS, MOST_PIECES = 12, 4096
"""Largest number of times that a face is cut into four, and largest number of pieces that are cut each time."""

_QUARTERS = np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[0, 2, 0], [0, 1, 1], [1, 1, 0]],
        [[0, 0, 2], [1, 0, 1], [0, 1, 1]],
        [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
    ]
) / 2  # fmt: skip
"""Barycentric coordinates (4, 3, 3) of the corners of the four quarters of a triangle."""


class Unresolved(ComputationError):
    """Elements are too large for the contact with an indenter."""


class Resolution(NamedTuple):
    """Measures of how well elements resolve the contact with a body; 0 if it does not touch the undeformed pad.

    Attributes
    ----------
    depth : float
        Depth of the body inside the deformed pad, relative to that in the undeformed pad.
    size : float
        Size of the largest face under a round body, the root of twice its area, relative to half the width of the
        contact.
    deepest : float
        Largest allowed ``depth``.
    """

    depth: float = 0.0
    size: float = 0.0
    deepest: float = DEEPEST

    @property
    def suffices(self) -> bool:
        """Whether elements are small enough for the force on the body to be right within about 8 %."""
        return self.depth <= self.deepest and self.size <= LARGEST


def resolution(mesh: VolumeMesh, indenter: Indenter, displacement: np.ndarray, moved: np.ndarray) -> Resolution:
    """Measures of how well the elements of a mesh resolve the contact with an indenter.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    indenter : Indenter
        The rigid body.
    displacement : (N, 3) ndarray
        Displacement of the nodes, in mm.
    moved : (3,) ndarray
        Displacement of the body from its start, in mm.

    Returns
    -------
    Resolution
        Depth and size.
    """
    return _resolution(mesh, indenter, np.ascontiguousarray(displacement, dtype=float).tobytes(), tuple(moved.tolist()))


@kept(4)  # a reading tests the elements of its two meshes several times
def _resolution(mesh: VolumeMesh, indenter: Indenter, displaced: bytes, movement: tuple[float, ...]) -> Resolution:
    displacement, moved = np.frombuffer(displaced).reshape(-1, 3), np.array(movement)
    body = indenter.body
    if moved[2] >= 0 or body.unbounded:
        return Resolution()
    length = body.pressure_length(-float(moved[2]))
    faces = mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]
    points = mesh.points - body.start(mesh.points[body.highest(mesh.points)]) - moved
    undeformed, touched_faces = _inside(body, points[faces], SPACING * length)
    if not len(touched_faces):
        return Resolution()
    deformed, _ = _inside(body, (points + displacement)[faces], SPACING * length)
    a, b, c = (points[faces[touched_faces, k]] for k in range(3))
    size = float(np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1)).max())
    if not body.contact_grows:
        return Resolution(deformed / undeformed, deepest=DEEPEST_AT_EDGES)
    return Resolution(deformed / undeformed, size / length)


def _inside(body: IndenterShape, face_nodes: np.ndarray, spacing: float) -> tuple[float, np.ndarray]:
    """Largest depth in mm of points of faces inside a body, and the numbers of the faces that enter the body.

    Faces have nodes (B, 6, 3) in mm, relative to the tip. They are cut into four as long as they may enter the body and
    are larger than the ``spacing`` in mm. If there are too many, only those nearest to the body, or deepest inside it,
    are cut.
    """
    deepest, touched = 0.0, np.zeros(len(face_nodes), dtype=bool)
    face, corners = np.arange(len(face_nodes)), np.broadcast_to(np.eye(3), (len(face_nodes), 3, 3))
    for _ in range(MOST_CUTS):
        positions = np.einsum(
            "tka,tai->tki", shape_functions(corners.reshape(-1, 3)).reshape(-1, 3, 6), face_nodes[face]
        )
        gap = body.gap(positions.reshape(-1, 3)).size.reshape(-1, 3).min(axis=1)
        deepest = max(deepest, -float(gap.min(initial=0.0)))
        touched[face[gap < 0]] = True
        size = BENT * np.linalg.norm(positions - np.roll(positions, 1, axis=1), axis=2).max(axis=1)
        candidates = np.flatnonzero((gap < size) & (size > spacing))
        if not len(candidates):
            break
        candidates = candidates[np.argsort(gap[candidates], kind="stable")[:MOST_PIECES]]
        face, corners = (
            face[candidates].repeat(4),
            np.einsum("qck,tkj->tqcj", _QUARTERS, corners[candidates]).reshape(-1, 3, 3),
        )
    return deepest, np.flatnonzero(touched)


def refuse_unresolved(
    mesh: VolumeMesh,
    indenter: Indenter,
    displacement: np.ndarray | None,
    moved: np.ndarray,
    mesh_size: float,
    largest: float = LARGEST,
) -> None:
    """Refuse elements that are too large for the contact with a body.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    indenter : Indenter
        The rigid body.
    displacement : (N, 3) ndarray or None
        Displacement of the nodes, in mm; None before the state is solved, where the size of the faces alone is judged.
    moved : (3,) ndarray
        Displacement of the body from its start, in mm.
    mesh_size : float
        Mesh size of the elements in mm, for the message.
    largest : float
        Allowed size of faces, relative to half the width of the contact.

    Raises
    ------
    Unresolved
        if elements are too large.
    """
    result = resolution(mesh, indenter, np.zeros_like(mesh.points) if displacement is None else displacement, moved)
    if result.size > largest:
        reason = f"their faces are {result.size:.2g} times half the width of its contact"
    elif displacement is not None and result.depth > result.deepest:
        reason = f"it penetrates the deformed pad by {result.depth:.0%} of that depth"
    else:
        return
    x, y = np.array(indenter.at) + moved[:2]
    raise Unresolved(
        f"the finite elements are too large for an indenter {-moved[2]:.3g} mm deep at ({x:.4g}, {y:.4g}) mm: "
        f"{reason}. A mesh_size of {0.5 * mesh_size:.2g} mm, or a deeper or larger indenter is needed."
    )
