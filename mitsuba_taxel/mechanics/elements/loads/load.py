"""What a load answers.

A load has a ``value``, which a load path varies: three components of a force [N] or displacement [mm], or a pressure
[MPa]. A new one is a frozen dataclass with a name. A force that is spread over a part of the top in its own way is a
`DeadForce`, which says how much area each node has of it::

    @dataclass(frozen=True)
    class CornerForce(DeadForce, name="corner_force"):
        width: float = number(1.0, "mm", "Side of the loaded square at the corner.", above=0)
        meaning = "on a corner of the top"
        loads_rim = True

        def nodal(self, mesh):
            ...

By its name it is a load of scenes, and its parameters are those of `deformable_pad` with ``load_`` before them.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.parameters import Parameter, check, parameters_of, values_of


@dataclass(frozen=True)
class Load(Kind, family="load"):
    """Quantity that a path varies, and the boundary condition that it stands for.

    What is prescribed follows from these attributes alone; nothing asks for the class of a load.

    Attributes
    ----------
    quantity, unit : str
        What its value is: "force" in N, "displacement" in mm, or "pressure" in MPa.
    components : int
        Of its value.
    bonded_plate : bool
        Whether a rigid plate is bonded to the top, which moves but does not rotate: by the value if that is a
        displacement, else under the value as its force.
    follows_surface : bool
        Whether it is a pressure on top and outside, normal to the deformed surface.
    dead : bool
        Whether it is a force that is spread over the undeformed top as `nodal` says, and keeps its direction.
    loads_rim : bool
        Whether corners of the free top are loaded, which may turn over by themselves.
    indenter : Indenter or None
        The rigid body that presses, in contact: moved by the value, or by what ``driven`` is.
    position : tuple of str
        Two parameters of scenes that are its position over the pad along x and y, by which readings have derivatives;
        empty for none.
    self_contact : bool
        Whether paths go on where the pad touches itself, the board or obstacles, by contact without friction.
    """

    quantity: ClassVar[str]
    unit: ClassVar[str]
    components: ClassVar[int]
    bonded_plate: ClassVar[bool] = False
    follows_surface: ClassVar[bool] = False
    dead: ClassVar[bool] = False
    loads_rim: ClassVar[bool]
    indenter: ClassVar[Indenter | None] = None
    position: ClassVar[tuple[str, ...]] = ()
    prefix = "load_"

    self_contact: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        require("self_contact", self.self_contact, bool, "True or False")
        check(self)

    @property
    def gives_displacement(self) -> bool:
        """Whether displacements are prescribed, and forces follow."""
        return self.unit == "mm"

    @property
    def moves_plate(self) -> bool:
        """Whether the displacement of a bonded plate is prescribed."""
        return self.bonded_plate and self.gives_displacement

    @property
    def moved_indenter(self) -> Indenter | None:
        """The indenter whose displacement is prescribed; None without one."""
        return self.indenter if self.gives_displacement else None

    @property
    def driven(self) -> Load | None:
        """The load that moves the indenter, and whose value follows from this one; None if no other does."""
        return None

    @property
    def has_position(self) -> bool:
        """Whether there is a position over the pad, by which states have a derivative."""
        return self.indenter is not None and not self.indenter.body.unbounded

    @property
    def area(self) -> float | None:
        """Area in mm² that a force is spread over, where that does not depend on the pad; else None."""
        return None

    @property
    def where(self) -> str:
        """What it acts on, in words for messages."""
        return "the top"

    def check(self, value: Sequence[float] | np.ndarray) -> None:
        """Refuse values that the load cannot have; raises `InputError`."""

    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """(N,) area in mm² of each node that a dead force acts on."""
        raise NotImplementedError(f"{self} is not spread over nodes")

    def loaded_area(self, mesh: VolumeMesh) -> float:
        """Undeformed area in mm² that it acts on; raises `InputError` if there is none."""
        return float(face_areas(mesh, top_faces(mesh)).sum())

    def is_symmetric(self, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
        """Whether its distribution is symmetric in a mirror of the mesh, which maps nodes to their ``image`` (N,)."""
        return True if self.indenter is None else self.indenter.body.keeps(mirror)

    @classmethod
    def why_no_first_contact(cls, change: np.ndarray) -> str:
        """Why the load at which a pad first touches something is not told along a change of the value; empty if it
        is."""
        return ""

    @classmethod
    def own_parameters(cls) -> Mapping[str, Parameter]:
        return parameters_of(cls)

    @classmethod
    def of_scene(cls, pad: Any, find: Any, **about: Any) -> Load:
        """The load of the parameters of a `deformable_pad`; ``find`` gives the path of a file that is named."""
        given = {name: getattr(pad, cls.prefix + name) for name in cls.own_parameters()}
        return cls(**given, **about)

    def scene_values(self) -> dict[str, Any]:
        """Its parameters in a scene, but that for ``self_contact``."""
        return {f"{self.prefix}{name}": value for name, value in values_of(self).items()}


@dataclass(frozen=True)
class DeadForce(Load):
    """A total force that is spread over the undeformed top, or a part of it, and keeps its direction."""

    quantity = "force"
    unit = "N"
    components = 3
    dead = True
    has_position = True
    uses: ClassVar[tuple[str, ...]] = ("force",)

    @abstractmethod
    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """Area of each node that the force acts on: the integral of the node's shape function over it.

        Only ratios count, so that it may be weighted. It has to change continuously with the points of the mesh:
        derivatives by shapes and positions are taken by its differences.

        Parameters
        ----------
        mesh : VolumeMesh
            Of the undeformed pad.

        Returns
        -------
        (N,) ndarray
            In mm², 0 for nodes on which no force acts.
        """

    def loaded_area(self, mesh: VolumeMesh) -> float:
        area = float(self.nodal(mesh).sum())
        if not area > 0:
            raise InputError(f"{self} is not allowed: it lies outside the top.")
        return area

    def is_symmetric(self, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
        nodal = self.nodal(mesh)
        return bool(np.allclose(nodal[image], nodal, rtol=0, atol=1e-12 * nodal.max(initial=0.0)))


def top_faces(mesh: VolumeMesh) -> np.ndarray:
    """(B, 6) nodes of the faces of the top."""
    return mesh.faces[mesh.face_region == REGIONS["top"]]


def face_areas(mesh: VolumeMesh, faces: np.ndarray) -> np.ndarray:
    """(B,) areas in mm² of flat faces (B, 6)."""
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
