"""Symmetries of a pad under one kind of load, and the parts of the pad between planes of symmetry, which are shared by
all states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.self_touching_pad import IndentedTouchingPad, SelfTouchingPad
from mitsuba_taxel.mechanics.materials.laws import Material


@kept(4)
def mirror_images(mesh: VolumeMesh, load: Load) -> dict[Mirror, np.ndarray]:
    """The common symmetries of mesh and load distribution, with the image (N,) of each node.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    load : Load
        Load whose distribution must be symmetric.

    Returns
    -------
    dict[Mirror, (N,) ndarray of int]
        Image node of each node, by mirror.
    """
    return {mirror: image for mirror, image in node_images(mesh).items() if load.is_symmetric(mesh, mirror, image)}


@kept(4)  # normal and tangential segments, also of the coarser mesh; more would take too much memory for matrices
def loaded_pad(
    mesh: VolumeMesh,
    material: Material,
    load: Load,
    mirrors: tuple[Mirror, ...],
    bodies: RigidBodies | None = None,
    ticks: int = TICKS,
) -> LoadedPad:
    """The part of a pad between planes of symmetry (mirrors), with the equations of its load. It has barriers against
    ``bodies`` if its load has ``self_contact``.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the whole undeformed pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Load on the whole pad.
    mirrors : tuple[Mirror, ...]
        Mirrors between which the part lies.
    bodies : RigidBodies, optional
        Rigid bodies that the pad must not penetrate.
    ticks : int
        Number of smallest fractions of a step. See :func:`new_pad`.

    Returns
    -------
    LoadedPad
        The part of the pad, whose equilibria can be solved.
    """
    return new_pad(mesh, material, load, mirrors, mirror_images(mesh, load), bodies, ticks=ticks)


def new_pad(
    mesh: VolumeMesh,
    material: Material,
    load: Load,
    mirrors: Sequence[Mirror],
    images: Mapping[Mirror, np.ndarray],
    bodies: RigidBodies | None = None,
    fraction: float = 1.0,
    ticks: int = TICKS,
) -> LoadedPad:
    """Create the part of a pad between planes of symmetry, as :func:`loaded_pad` does. The result is not shared with
    other callers.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Kind of load.
    mirrors : Sequence[Mirror]
        Mirrors between which the part lies.
    images : Mapping[Mirror, ndarray]
        Images of the nodes.
    bodies : RigidBodies, optional
        Bodies that the pad may touch.
    fraction : float
        Reach of the barriers and size of the feet, relative to the default.
    ticks : int
        Number of smallest fractions of a step; see :func:`ticks_of`.

    Returns
    -------
    LoadedPad
        The part of the pad, whose equilibria can be solved.
    """
    indented, arguments = load.moved_indenter is not None, (mesh, material, load, mirrors, images)
    if load.self_contact:
        return (IndentedTouchingPad if indented else SelfTouchingPad)(
            *arguments, bodies=bodies, fraction=fraction, ticks=ticks
        )
    return (IndentedPad if indented else LoadedPad)(*arguments, ticks=ticks)
