"""Comparison with CalculiX on the same mesh: a rigid ball is pressed into a pad with one hemispheric cell, beside its
centre."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import trimesh

from mitsuba_taxel.evidence.peers import calculix
from mitsuba_taxel.evidence.peers.displacement_form import DisplacementForm
from mitsuba_taxel.geometry.volume_mesh import TET_FACES, VolumeMesh
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.loads import IndenterDisplacement
from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of
from mitsuba_taxel.pads import REGIONS, Pad

PAD = Pad("hemispheric", rows=1, columns=1)
BALL = Indenter("sphere", radius=2.5, at=(0.5, 0.3))
MATERIAL = NeoHookean(poisson_ratio=0.3)
"""Compressible material, because the element of CalculiX has displacement unknowns only."""
MESH_SIZES = (1.25, 0.8)
DEPTHS = (0.25, 1.0)
COLUMNS = (
    "mesh size", "depth mm", "unknowns", "force N", "ccx N", "force difference", "rms difference", "same element",
    "ccx seconds",
)  # fmt: skip

STIFFNESS = 2e4
"""Penalty stiffness of the contact, pressure divided by penetration, in MPa/mm. The penetration is then a tenth of a
micrometre."""
INCREMENT = 0.1
"""Displacement of the ball in one increment, in mm."""
CUTS = 6
"""Number of halvings of an icosahedron's edges: sides of 0.045 mm, whose facets lean by half a degree."""
CAP, LARGEST_CAP = 1.06, 0.95
"""Radius of the part of the ball that is meshed, relative to that at the height of the undeformed top, and to the
ball's."""
SHELL = 0.9
"""Inner radius of its single layer of wedges."""


def table(mesh_sizes: Sequence[float], depths: Sequence[float]) -> Iterator[tuple[object, ...]]:
    """Compare both programs for several mesh sizes and depths, and yield rows with the columns :data:`COLUMNS`.

    Parameters
    ----------
    mesh_sizes, depths : sequence of float
        Mesh sizes and depths in mm.

    Raises
    ------
    ComputationError
        if CalculiX is not installed.
    """
    calculix.require()
    for mesh_size in mesh_sizes:
        for depth in depths:
            yield row_of(mesh_size, depth)


def row_of(mesh_size: float, depth: float) -> tuple[object, ...]:
    """Compare both programs for one mesh size and one depth, both in mm. Returns the row of the table."""
    (state,) = load_path(PAD, MATERIAL, [(0, 0, -depth)], load=IndenterDisplacement(BALL), mesh_size=mesh_size)
    ours, peer = indentation_of(state)[1].force, press(state.mesh, MATERIAL, BALL, depth)
    difference = np.linalg.norm(peer.force - ours) / np.linalg.norm(ours)
    return (
        mesh_size,
        depth,
        state.displacement.size,
        f"{-ours[2]:.4f}",
        f"{-peer.force[2]:.4f}",
        f"{difference:.2%}",
        f"{rms_apart(peer.displacement, state.displacement):.2%}",
        f"{rms_apart(peer.displacement, under_same_forces(state)):.2%}",
        f"{peer.seconds:.0f}",
    )


def rms_apart(displacement: np.ndarray, reference: np.ndarray) -> float:
    """Relative difference of two displacements: root mean square over N nodes, divided by that of the second
    displacement.

    Parameters
    ----------
    displacement, reference : (N, 3) ndarray
        Displacement of each node and its reference value, in the same unit.
    """
    return float(np.linalg.norm(displacement - reference) / np.linalg.norm(reference))


def under_same_forces(state: State) -> np.ndarray:
    """Displacement (N, 3) in mm of the N nodes under the contact forces of a state, computed with the implementation of
    CalculiX's element in `displacement_form`."""
    assert isinstance(state.material, NeoHookean)
    element, pushed = DisplacementForm(state.mesh, state.material), indentation_of(state)[1].nodal_forces
    displacement, steps = np.zeros_like(pushed), math.ceil(abs(state.value[2]) / INCREMENT)
    for step in range(1, steps + 1):
        displacement = element.equilibrium(displacement, step / steps * pushed)
    return displacement


def press(mesh: VolumeMesh, material: NeoHookean, ball: Indenter, depth: float) -> calculix.CalculixRun:
    """Compute, by CalculiX, the deformation of a pad into whose top a ball is pressed without friction.

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    material : NeoHookean
        The law.
    ball : Indenter
        The ball.
    depth : float
        Downward displacement of the ball in mm.
    """
    return calculix.run(deck(mesh, material, ball, depth), len(mesh.points))


def deck(mesh: VolumeMesh, material: NeoHookean, ball: Indenter, depth: float) -> str:
    """Input text of CalculiX for :func:`press`. The ball is represented by the lower part of a shell of wedge elements,
    whose nodes all have the same displacement.

    Parameters
    ----------
    mesh, material, ball, depth
        See :func:`press`.
    """
    # The mesh of pad and ball.
    points, wedges = _shell(ball, float(mesh.points[:, 2].max()), depth)
    first_node, first_element = 1 + len(mesh.points), 1 + len(mesh.tets)
    lines = calculix.pad_lines(mesh, material)
    lines += ["*NODE, NSET=BALL", *calculix.node_lines(points, first_node), "*ELEMENT, TYPE=C3D6, ELSET=BALL"]
    lines += [",".join(map(str, (n, *nodes))) for n, nodes in enumerate(wedges + first_node, start=first_element)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "1e5,0.3", "*SOLID SECTION, ELSET=BALL, MATERIAL=STEEL"]
    # Contact between the top of the pad and the outside of the shell.
    lines += ["*SURFACE, NAME=TOP, TYPE=ELEMENT", *(f"{n},S{side}" for n, side in _top_sides(mesh))]
    lines += ["*SURFACE, NAME=OUTSIDE, TYPE=ELEMENT", "BALL,S2", "*SURFACE INTERACTION, NAME=FREE"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{STIFFNESS:g},1e-6"]
    lines += ["*CONTACT PAIR, INTERACTION=FREE, TYPE=NODE TO SURFACE", "TOP,OUTSIDE"]
    # The displacement in increments, and what is printed.
    increment = min(1.0, INCREMENT / depth)
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", f"{increment:g},1.,1e-5,{increment:g}", "*BOUNDARY"]
    lines += ["BALL,1,2,0.", f"BALL,3,3,{-depth:.13e}"]
    lines += ["*NODE PRINT, NSET=PAD, FREQUENCY=1000000", "U"]
    lines += ["*NODE PRINT, NSET=BALL, TOTALS=ONLY, FREQUENCY=1000000", "RF", "*END STEP", ""]
    return "\n".join(lines)


def _shell(ball: Indenter, lowest: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Mesh of the lower part of a ball, whose lowest point is at the height ``lowest`` in mm: N nodes (N, 3) and W
    wedges (W, 6) as indices of nodes.

    The part is a little wider than the section of the ball at this height after a displacement by ``depth``. The outer
    facets, formed by the last three nodes of each wedge, are scaled so that they enclose the volume of the ball.
    """
    assert ball.radius is not None
    touched = math.sqrt(1 - (1 - min(depth / ball.radius, 1.0)) ** 2)
    cap = min(CAP * touched, LARGEST_CAP)
    sphere = trimesh.creation.icosphere(CUTS)
    in_cap = (sphere.vertices[sphere.faces][:, :, 2] < -math.sqrt(1 - cap**2)).all(axis=1)
    used, facets = np.unique(sphere.faces[in_cap], return_inverse=True)
    facets = facets.reshape(-1, 3)
    swelling = (4 / 3 * math.pi / sphere.volume) ** (1 / 3)
    middle = np.array([*ball.at, lowest + ball.radius])
    outside, inside = (middle + radius * ball.radius * sphere.vertices[used] for radius in (swelling, SHELL))
    return np.concatenate([outside, inside]), np.concatenate([len(used) + facets, facets], axis=1)


def _top_sides(mesh: VolumeMesh) -> Iterator[tuple[int, int]]:
    """For each element with a face in the top of the pad: its number, and the number of this face in CalculiX."""
    top = {tuple(corners) for corners in np.sort(mesh.faces[mesh.face_region == REGIONS["top"]][:, :3], axis=1)}
    sides = np.sort(mesh.tets[:, np.array(TET_FACES)[:, :3]], axis=2)
    for element, of_element in enumerate(sides, start=1):
        for side, corners in enumerate(of_element, start=1):
            if tuple(corners) in top:
                yield element, side
