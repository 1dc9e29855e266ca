"""A rigid ball pressed into one hemispheric cell off its centre, by CalculiX on our mesh."""

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
"""Compressible, as the program's element has displacements alone."""
MESH_SIZES = (1.25, 0.8)
DEPTHS = (0.25, 1.0)
COLUMNS = (
    "mesh size", "depth mm", "unknowns", "force N", "ccx N", "force apart", "rms apart", "same element", "ccx seconds"
)  # fmt: skip

STIFFNESS = 2e4
"""MPa/mm, pressure over penetration: a tenth of a micrometre."""
INCREMENT = 0.1
"""Way of the ball in one increment, in mm."""
CUTS = 6
"""Number of halvings of an icosahedron's edges: sides of 0.045 mm, whose facets lean by half a degree."""
CAP, LARGEST_CAP = 1.06, 0.95
"""Radius of the part of the ball that is meshed, relative to that at the height of the undeformed top, and to the
ball's."""
SHELL = 0.9
"""Inner radius of its single layer of wedges."""


def table(mesh_sizes: Sequence[float], depths: Sequence[float]) -> Iterator[tuple[object, ...]]:
    """Rows for every mesh size and depth [mm], :data:`COLUMNS`, as they are measured.

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
    """A row of the table."""
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
    """Difference of two displacements (N, 3), relative to the second, root mean square over the nodes."""
    return float(np.linalg.norm(displacement - reference) / np.linalg.norm(reference))


def under_same_forces(state: State) -> np.ndarray:
    """Displacement (N, 3) in mm of the peer's kind of element under the contact forces of a state of ours."""
    assert isinstance(state.material, NeoHookean)
    element, pushed = DisplacementForm(state.mesh, state.material), indentation_of(state)[1].pushed
    displacement, steps = np.zeros_like(pushed), math.ceil(abs(state.value[2]) / INCREMENT)
    for step in range(1, steps + 1):
        displacement = element.equilibrium(displacement, step / steps * pushed)
    return displacement


def press(mesh: VolumeMesh, material: NeoHookean, ball: Indenter, depth: float) -> calculix.CalculixRun:
    """CalculiX's state of a pad into whose top a ball is moved by a ``depth`` in mm, without friction."""
    return calculix.run(deck(mesh, material, ball, depth), len(mesh.points))


def deck(mesh: VolumeMesh, material: NeoHookean, ball: Indenter, depth: float) -> str:
    """Input of the program. The ball is the lower part of a shell of wedges, all of whose nodes are moved."""
    points, wedges = _shell(ball, float(mesh.points[:, 2].max()), depth)
    first_node, first_element = 1 + len(mesh.points), 1 + len(mesh.tets)
    lines = calculix.pad_lines(mesh, material)
    lines += ["*NODE, NSET=BALL", *calculix.node_lines(points, first_node), "*ELEMENT, TYPE=C3D6, ELSET=BALL"]
    lines += [",".join(map(str, (n, *nodes))) for n, nodes in enumerate(wedges + first_node, start=first_element)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "1e5,0.3", "*SOLID SECTION, ELSET=BALL, MATERIAL=STEEL"]
    lines += ["*SURFACE, NAME=TOP, TYPE=ELEMENT", *(f"{n},S{side}" for n, side in _top_sides(mesh))]
    lines += ["*SURFACE, NAME=OUTSIDE, TYPE=ELEMENT", "BALL,S2", "*SURFACE INTERACTION, NAME=FREE"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{STIFFNESS:g},1e-6"]
    lines += ["*CONTACT PAIR, INTERACTION=FREE, TYPE=NODE TO SURFACE", "TOP,OUTSIDE"]
    increment = min(1.0, INCREMENT / depth)
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", f"{increment:g},1.,1e-5,{increment:g}", "*BOUNDARY"]
    lines += ["BALL,1,2,0.", f"BALL,3,3,{-depth:.13e}"]
    lines += ["*NODE PRINT, NSET=PAD, FREQUENCY=1000000", "U"]
    lines += ["*NODE PRINT, NSET=BALL, TOTALS=ONLY, FREQUENCY=1000000", "RF", "*END STEP", ""]
    return "\n".join(lines)


def _shell(ball: Indenter, lowest: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (N, 3) and wedges (W, 6) below a ball whose lowest point is at a height in mm, as far as it meets what is
    at that height once it is moved; facets outside enclose the volume of the ball, and are the wedges' last three
    nodes."""
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
    """Number of each element with a face in the top, and that of the face, as the program numbers them."""
    top = {tuple(corners) for corners in np.sort(mesh.faces[mesh.face_region == REGIONS["top"]][:, :3], axis=1)}
    sides = np.sort(mesh.tets[:, np.array(TET_FACES)[:, :3]], axis=2)
    for element, of_element in enumerate(sides, start=1):
        for side, corners in enumerate(of_element, start=1):
            if tuple(corners) in top:
                yield element, side
