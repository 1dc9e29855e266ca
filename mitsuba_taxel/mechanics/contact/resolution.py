"""Whether elements are small enough for the contact with an indenter.

The gap to a body is not negative on average around each node. Between nodes the body may be inside the pad, and one
that is smaller than an element is not felt at all. Two figures tell: the depth of the body inside the deformed pad,
relative to that in the undeformed one, and the size of the faces under it, relative to half the width of the contact.
Against much smaller elements, forces of balls on a block are right to 8 % within both limits; beyond, all of the force
may be missing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.pads.regions import REGIONS

DEEPEST, DEEPEST_AT_EDGES = 0.25, 0.6
"""Largest depth of a body inside the deformed pad, relative to that in the undeformed one, and of one with a flat end:
at its edge the pad rises steeply between nodes, which hardly changes the force."""
LARGEST, WANTED = 2.0, 1.5
"""Largest face under a body, relative to half the width of the contact, and where elements can still be made smaller:
between the two, forces of balls whose tip is between nodes are up to 25 % too small."""
SPACING = 0.25
"""Distance of the points that are tested, relative to half the width of the contact."""
BENT = 1.2
"""Largest ratio of lengths on curved faces and between their corners."""
MOST_CUTS, MOST_NEAR = 12, 4096
"""Cuts of a face into four, one within the other, and pieces that are cut at once."""

_QUARTERS = np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[0, 2, 0], [0, 1, 1], [1, 1, 0]],
        [[0, 0, 2], [1, 0, 1], [0, 1, 1]],
        [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
    ]
) / 2  # fmt: skip
"""(4, 3, 3) barycentric coordinates of the corners of the four quarters of a triangle."""


class Unresolved(ComputationError):
    """Elements are too large for the contact with an indenter."""


class Resolution(NamedTuple):
    """How elements resolve the contact with a body; zeros where it does not touch the undeformed pad.

    Attributes
    ----------
    depth : float
        Of the body inside the deformed pad, relative to that in the undeformed one.
    size : float
        Of the largest face under a round body, the root of twice its area, relative to half the width of the contact.
    deepest : float
        Largest allowed ``depth``.
    """

    depth: float = 0.0
    size: float = 0.0
    deepest: float = DEEPEST

    @property
    def suffices(self) -> bool:
        """Whether the force on the body is right to some 8 %."""
        return self.depth <= self.deepest and self.size <= LARGEST


def resolution(mesh: VolumeMesh, indenter: Indenter, displacement: np.ndarray, moved: np.ndarray) -> Resolution:
    """How the elements of a mesh resolve the contact with an indenter.

    Parameters
    ----------
    displacement : (N, 3) ndarray
        Of the nodes, in mm.
    moved : (3,) ndarray
        In mm, how far the body is from where it starts.
    """
    body = indenter.body
    if moved[2] >= 0 or body.unbounded:
        return Resolution()
    length = body.pressure_length(-float(moved[2]))
    faces = mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]
    places = mesh.points - body.start(mesh.points[body.highest(mesh.points)]) - moved
    undeformed, under = _inside(body, places[faces], SPACING * length)
    if not len(under):
        return Resolution()
    deformed, _ = _inside(body, (places + displacement)[faces], SPACING * length)
    a, b, c = (places[faces[under, k]] for k in range(3))
    size = float(np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1)).max())
    if not body.contact_grows:
        return Resolution(deformed / undeformed, deepest=DEEPEST_AT_EDGES)
    return Resolution(deformed / undeformed, size / length)


def _inside(body: IndenterShape, nodes: np.ndarray, spacing: float) -> tuple[float, np.ndarray]:
    """Largest depth in mm of points of faces inside a body, and the numbers of the faces that have such points.

    Faces, of ``nodes`` (B, 6, 3) relative to the tip, are cut into four as long as they may enter the body and are
    larger than the ``spacing`` in mm; of many, those that are nearest to it or deepest inside.
    """
    deepest, touched = 0.0, np.zeros(len(nodes), dtype=bool)
    face, corners = np.arange(len(nodes)), np.broadcast_to(np.eye(3), (len(nodes), 3, 3))
    for _ in range(MOST_CUTS):
        places = np.einsum("tka,tai->tki", shape_functions(corners.reshape(-1, 3)).reshape(-1, 3, 6), nodes[face])
        gap = body.gap(places.reshape(-1, 3)).size.reshape(-1, 3).min(axis=1)
        deepest = max(deepest, -float(gap.min(initial=0.0)))
        touched[face[gap < 0]] = True
        size = BENT * np.linalg.norm(places - np.roll(places, 1, axis=1), axis=2).max(axis=1)
        near = np.flatnonzero((gap < size) & (size > spacing))
        if not len(near):
            break
        near = near[np.argsort(gap[near], kind="stable")[:MOST_NEAR]]
        face, corners = face[near].repeat(4), np.einsum("qck,tkj->tqcj", _QUARTERS, corners[near]).reshape(-1, 3, 3)
    return deepest, np.flatnonzero(touched)


def refuse_unresolved(
    mesh: VolumeMesh,
    indenter: Indenter,
    displacement: np.ndarray | None,
    moved: np.ndarray,
    mesh_size: float,
    largest: float = LARGEST,
) -> None:
    """Raise :class:`Unresolved` if elements, of ``mesh_size`` mm, are too large for the contact with a body.

    Faces may have ``largest`` times half the width of the contact.
    Before a state is solved, without its ``displacement``, their size alone is judged.
    """
    found = resolution(mesh, indenter, np.zeros_like(mesh.points) if displacement is None else displacement, moved)
    if found.size > largest:
        why = f"their faces are {found.size:.2g} times half the width of its contact"
    elif displacement is not None and found.depth > found.deepest:
        why = f"it is inside the pad by {found.depth:.0%} of that"
    else:
        return
    x, y = np.array(indenter.at) + moved[:2]
    raise Unresolved(
        f"the finite elements are too large for an indenter {-moved[2]:.3g} mm deep at ({x:.4g}, {y:.4g}) mm: {why}. "
        f"A mesh_size of {0.5 * mesh_size:.2g} mm, or a deeper or larger indenter is needed."
    )
