"""A plate bonded to one hemispheric cell that tilts under a force and a moment, by CalculiX on our mesh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mitsuba_taxel.evidence.peers import calculix
from mitsuba_taxel.evidence.peers.displacement_form import held
from mitsuba_taxel.evidence.peers.pressed_ball import rms_apart
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.mechanics.elements.loads import PlateWrench
from mitsuba_taxel.mechanics.elements.nodal_forces import nodes_of
from mitsuba_taxel.mechanics.elements.plate_rotation import rotation_matrix, rotation_vector
from mitsuba_taxel.mechanics.results.balance import reactions
from mitsuba_taxel.pads import Pad

PAD = Pad("hemispheric", rows=1, columns=1)
LOAD = PlateWrench(x=0.5)
MATERIAL = NeoHookean(poisson_ratio=0.3)
"""Compressible, as the element of CalculiX has displacements alone."""
MESH_SIZES = (1.6, 1.25)
WRENCHES = {"small": (0.0, 0.0, -0.5, 0.0, 0.8, 0.0), "large": (0.3, 0.2, -4.0, 3.0, 4.0, 2.0)}
"""Forces in N and moments in N mm."""
INCREMENTS = {"small": 1.0, "large": 0.25}
"""Increments of CalculiX, as fractions of the load."""
COLUMNS = (
    "mesh size", "tilt", "degrees", "ccx degrees", "rotation difference", "rms difference", "force difference",
    "moment difference", "ccx seconds",
)  # fmt: skip


def table(mesh_sizes: Sequence[float], tilts: Sequence[str]) -> Iterator[tuple[object, ...]]:
    """Compare both programs for several mesh sizes and tilts of the plate, and yield rows with the columns
    :data:`COLUMNS` as they are measured.

    Parameters
    ----------
    mesh_sizes : sequence of float
        Mesh sizes in mm.
    tilts : sequence of str
        Keys of :data:`WRENCHES`.

    Raises
    ------
    ComputationError
        if CalculiX is not installed.
    """
    calculix.require()
    for mesh_size in mesh_sizes:
        for tilt in tilts:
            yield row_of(mesh_size, tilt)


def row_of(mesh_size: float, tilt: str) -> tuple[object, ...]:
    """Compare both programs for one mesh size in mm and one tilt of the plate. Returns the row of the table.

    CalculiX solves the pad under the force and the moment, and then under the motion of our plate. Differences of force
    and moment are those of the board's reactions to the same motion.
    """
    wrench, increment = np.array(WRENCHES[tilt]), INCREMENTS[tilt]
    (state,) = load_path(PAD, MATERIAL, wrench[None], load=LOAD, mesh_size=mesh_size)
    mesh, top = state.mesh, nodes_of(state.mesh, "top")
    turned = rotation_vector(mesh.points[top], state.displacement[top])
    arm = mesh.points[top[0]] - LOAD.pivot(mesh)
    moved = state.displacement[top[0]] - (rotation_matrix(turned) @ arm - arm)

    loaded = calculix.run(deck(mesh, MATERIAL, wrench, increment), len(mesh.points))
    peer_turned = rotation_vector(mesh.points[top], loaded.displacement[top])
    ours = reactions(state)
    driven = calculix.run(deck(mesh, MATERIAL, np.append(moved, turned), increment, True), len(mesh.points))
    force, moment = driven.held_force.sum(axis=0), np.cross(mesh.points[driven.held], driven.held_force).sum(axis=0)
    return (
        mesh_size,
        tilt,
        f"{np.degrees(np.linalg.norm(turned)):.4g}",
        f"{np.degrees(np.linalg.norm(peer_turned)):.4g}",
        f"{rms_apart(peer_turned, turned):.2%}",
        f"{rms_apart(loaded.displacement, state.displacement):.2%}",
        f"{rms_apart(force, ours.force):.2%}",
        f"{rms_apart(moment, ours.moment):.2%}",
        f"{loaded.seconds + driven.seconds:.0f}",
    )


def deck(mesh: VolumeMesh, material: NeoHookean, value: np.ndarray, increment: float, moved: bool = False) -> str:
    """Input text of CalculiX: the nodes of the top are a rigid body, with a node for its displacement and one for its
    rotation.

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    material : NeoHookean
        The law.
    value : (6,) ndarray
        Force in N and moment in N mm or, if the body is ``moved``, displacement in mm and rotation vector in radians.
    increment : float
        Fraction of the value in one increment.
    moved : bool
        Whether the body's motion is prescribed.
    """
    first = len(mesh.points) + 1
    pivot = LOAD.pivot(mesh)[None]
    lines = ["*NODE, NSET=REFERENCE", *calculix.node_lines(pivot, first)]
    lines += ["*NODE, NSET=ROTATION", *calculix.node_lines(pivot, first + 1), *calculix.pad_lines(mesh, material)]
    lines += ["*NSET, NSET=TOP", *(f"{n}," for n in nodes_of(mesh, "top") + 1)]
    lines += ["*NSET, NSET=BOARD", *(f"{n}," for n in np.flatnonzero(held(mesh)) + 1)]
    lines += [f"*RIGID BODY, NSET=TOP, REF NODE={first}, ROT NODE={first + 1}"]
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", f"{increment:g},1.,1e-5,{increment:g}"]
    lines += ["*BOUNDARY" if moved else "*CLOAD"]
    components = [(first + k // 3, k % 3 + 1, number) for k, number in enumerate(value)]
    lines += [f"{node},{axis},{axis},{n:.13e}" if moved else f"{node},{axis},{n:.13e}" for node, axis, n in components]
    lines += ["*NODE PRINT, NSET=PAD, FREQUENCY=1000000", "U"]
    lines += ["*NODE PRINT, NSET=BOARD, FREQUENCY=1000000", "RF", "*END STEP", ""]
    return "\n".join(lines)
