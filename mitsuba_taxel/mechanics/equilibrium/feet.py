"""Linear material law at the feet of a pad: the points where two upright free sides of a pad meet its glued bottom.

With any law for large strains, the volume ratio at a foot falls to zero as elements become smaller, and silicone rolls
over onto the board. The load path of a pad with ``self_contact`` would end there, at a load that depends on the
elements. A linear law has no such limit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import rim_corners
from mitsuba_taxel.mechanics.elements.elements import Elements, SmallStrain, quadrature_places
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.viscoelastic import tensors

RADIUS = 1 / 15
"""Distance from a foot, relative to the pad's height, within which the law is linear if the load path continues after
contact."""
SHARP = 30.0
"""Least turn of the glued outer rim at a foot, in degrees."""


def where_linear(mesh: VolumeMesh, load: Load, fraction: float = 1.0) -> np.ndarray | None:
    """Quadrature points of the elements at which the law is linear: those near the feet of the pad's upright outer
    edges.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    load : Load
        Load on the pad.
    fraction : float
        Radius of the feet, relative to :data:`RADIUS`.

    Returns
    -------
    (m, q) ndarray of bool or None
        Mask of the points; None without such points: under loads whose path ends at the first contact, and in round
        pads.
    """
    if not load.self_contact:
        return None
    nodes_near = near_feet(mesh, fraction)
    return nodes_near if nodes_near.any() else None


def near_feet(mesh: VolumeMesh, fraction: float = 1.0) -> np.ndarray:
    """Mask (m, q): whether the q quadrature points of m elements are near a foot, where an upright outer edge meets the
    glued bottom. They are if the distance is less than ``fraction`` times :data:`RADIUS` times the pad's height.
    """
    return are_at_feet(mesh, quadrature_places(mesh), fraction)


def said_of(touched: str, mesh: VolumeMesh, place: np.ndarray) -> str:
    """Explanation, for an error message, of a contact between pad and board near a foot: a point where two upright free
    sides meet the bottom.

    Parameters
    ----------
    touched : str
        Object that the pad touches.
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    place : (3,) ndarray
        Point of contact, mm.

    Returns
    -------
    str
        The sentence; empty unless the pad touches the board below a foot.
    """
    if touched != "the board" or not are_at_feet(mesh, place):
        return ""
    return " This point is at the foot of an upright edge, which rolls over at a smaller load on smaller elements."


def couple_held(
    mesh: VolumeMesh,
    material: Material,
    linear: np.ndarray,
    displacement: np.ndarray,
    pressure: np.ndarray,
    overstress: np.ndarray | None = None,
) -> np.ndarray:
    """Moment that the board would have to hold because the law is linear at the feet of a pad.

    Under any other law the moment of the nodal forces is zero. The linear law is valid for small rotations only: it
    resists larger rotations with a moment, as if the board held the feet.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    material : Material
        Elastic law of the silicone.
    linear : (m, q) ndarray of bool
        Quadrature points where the law is linear.
    displacement : (N, 3) ndarray
        Displacement of the nodes, mm.
    pressure : (corners,) ndarray
        Pressure at each corner of the elements in MPa, positive in tension.
    overstress : (m, q, 6) ndarray, optional
        Viscoelastic stress in addition to the stress of the law, MPa.

    Returns
    -------
    (3,) ndarray
        Moment about the origin, N mm.
    """
    at = np.flatnonzero(linear.any(axis=1))
    elements, every = Elements(replace(mesh, tets=mesh.tets[at]), material), slice(None)
    where, gradient = linear[at], elements.gradient(every, displacement)
    stress = elements.pressures(every, pressure)[..., None, None] * np.eye(3)
    stress[where] += SmallStrain(where, gradient[where]).stress(material.shear_modulus)
    if overstress is not None:
        stress[where] += tensors(overstress[at][where])
    virial = np.einsum("mq,mqij,mqkj->ik", elements.weight * where, gradient, stress)
    return np.array([virial[1, 2] - virial[2, 1], virial[2, 0] - virial[0, 2], virial[0, 1] - virial[1, 0]])


def are_at_feet(mesh: VolumeMesh, places: np.ndarray, fraction: float = 1.0) -> np.ndarray:
    """Mask (...): whether places (..., 3) in mm are near a foot, a point where upright outer edges meet the glued
    bottom: closer than ``fraction`` times :data:`RADIUS` times the pad's height."""
    inside, radius = np.zeros(places.shape[:-1], dtype=bool), fraction * RADIUS * float(np.ptp(mesh.points[:, 2]))
    for foot in mesh.points[rim_corners(mesh, "bottom", SHARP)]:
        inside |= np.linalg.norm(places - foot, axis=-1) < radius
    return inside
