"""The problem that a load path solves: a pad of one material under one kind of load, on elements of one size."""

from __future__ import annotations

import json
import threading
from dataclasses import asdict
from functools import cached_property
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from mitsuba_taxel.base.sources import own_code
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.equilibrium.natural_step import natural_step
from mitsuba_taxel.mechanics.equilibrium.pad_parts import mirror_images
from mitsuba_taxel.mechanics.local_mesh import Refinement, mesh_under
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads.any_pad import AnyPad

_LOCKS: WeakValueDictionary[str, Any] = WeakValueDictionary()
_OF_LOCKS = threading.Lock()


def lock_of(pad: AnyPad) -> Any:
    """The lock that guards the data of a pad: its paths share meshes, factors and states, which only one thread may
    change at a time.

    Paths of different pads share no data that changes, so threads can solve them concurrently.

    Parameters
    ----------
    pad : AnyPad
        The pad.

    Returns
    -------
    threading.RLock
        The same lock for all callers while it is in use.
    """
    with _OF_LOCKS:
        return _LOCKS.setdefault(json.dumps(pad.identity, sort_keys=True), threading.RLock())


class PathProblem:
    """A pad with its material, load and elements, and quantities that depend on nothing else.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Kind of load.
    mesh_size : float
        Mesh size in mm.
    judged : bool
        Whether states must be stable against all displacements, not only those with the symmetry of the load.
    bodies : RigidBodies or None
        Bodies that the states may touch, if the load has ``self_contact``.
    step_tolerance : float
        Allowed root mean square error of displacements that are interpolated between two nodes of the path, relative
        to the largest displacement; its default is
        :data:`~mitsuba_taxel.mechanics.continuation.load_segment.INTERPOLATION_TOLERANCE`.
    refinement : Refinement or None
        Refinement under an indenter: by default, elements there are never larger than those of a mesh of the default
        size.
    """

    def __init__(
        self,
        pad: AnyPad,
        material: Material,
        load: Load,
        mesh_size: float,
        judged: bool,
        bodies: RigidBodies | None,
        step_tolerance: float,
        refinement: Refinement | None,
    ) -> None:
        self.pad, self.material, self.load, self.mesh_size, self.bodies = pad, material, load, mesh_size, bodies
        self.judged, self.step_tolerance, self._refinement = judged, step_tolerance, refinement
        self.lock = lock_of(pad)

    @cached_property
    def _identity(self) -> list[Any]:
        if self.load.indenter is None:
            return [self.pad.identity, self.mesh_size]
        return [self.pad.identity, self.mesh_size, asdict(self.load.indenter), asdict(self.refinement)]

    @cached_property
    def refinement(self) -> Refinement:
        """How the mesh is refined under an indenter."""
        return self._refinement or Refinement(min(1.0, self.mesh_size / self.pad.default_mesh_size))

    @cached_property
    def mesh(self) -> VolumeMesh:
        """Finite-element mesh of the undeformed pad."""
        indenter = self.load.indenter
        if indenter is None:
            return pad_mesh(self.pad, self.mesh_size)
        name = cache.key("mesh", self._identity)
        with cache.alone(name):
            arrays = cache.load(name)
            if arrays is None:
                mesh = mesh_under(pad_mesh(self.pad, self.mesh_size), indenter, self.refinement)
                cache.store(name, vars(mesh))
                return mesh
        return VolumeMesh(**arrays)

    @cached_property
    def images(self) -> dict[Mirror, np.ndarray]:
        """The common planes of symmetry (mirrors) of mesh, load and bodies, each with the image (N,) of each of the N
        nodes.
        """
        images = mirror_images(self.mesh, self.load)
        return {mirror: image for mirror, image in images.items() if self.bodies is None or self.bodies.kept_by(mirror)}

    @cached_property
    def contact(self) -> ContactTest:
        """Contact test for displacements of the whole pad, which must not touch itself, the board or bodies."""
        return ContactTest(self.mesh, None if self.bodies is None else self.bodies.triangles)

    @cached_property
    def own_contact_at_rest(self) -> Contact | None:
        """A contact of the undeformed pad with the board or itself; of several that are mirror images, only one."""
        kept = np.ones(len(self.mesh.points), dtype=bool)
        for mirror in self.images:
            kept &= mirror.side(self.mesh.points) >= 0
        return ContactTest(self.mesh, nodes=np.flatnonzero(kept)).at_rest

    @cached_property
    def step(self) -> float:
        """Change of the load's value in a whole step, in N, mm or MPa."""
        return natural_step(self.mesh, self.material, self.load)

    @property
    def key_parts(self) -> list[Any]:
        """Pad, material, load and bodies, from which names of cached files are computed."""
        material = [_name_of(self.material), *(getattr(self.material, name) for name in self.material.parameters)]
        bodies = [] if self.bodies is None else [self.bodies.triangles.tolist()]
        return [self._identity, material, [_name_of(self.load), asdict(self.load)], *bodies]


def _name_of(instance: object) -> str:
    """The class of an object, and the code of the class if it is not part of this package."""
    kind: Any = type(instance)
    return f"{kind.__module__}.{kind.__qualname__}{own_code(kind)}"
