"""Base classes of the loads of a pad.

A load has a ``value``, which a load path varies: three components of a force [N] or displacement [mm], a pressure
[MPa], or three components of a force and three of a moment [N mm]. A new load is a frozen dataclass with a name. A
force that is spread over a region of the top is a `DeadForce`, which gives the area of each node in that region::

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
from mitsuba_taxel.mechanics.contact.ipc_toolkit import require_ipctk
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.parameters import Parameter, check, parameters_of, values_of


@dataclass(frozen=True)
class Load(Kind, family="load"):
    """A kind of load: the quantity that a load path varies, and the boundary condition.

    The boundary condition follows from these attributes alone; no code tests the class of a load.

    Attributes
    ----------
    quantity, unit : str
        Quantity and unit of the load's value: "force" in N, "displacement" in mm, or "pressure" in MPa.
    components : int
        Number of components of its value.
    bonded_plate : bool
        Whether a rigid plate is bonded to the top. The value is its displacement or the force on it.
    tilts : bool
        Whether this plate rotates, too. The value is a force and a moment.
    follows_surface : bool
        Whether it is a pressure on top and outside, normal to the deformed surface.
    dead : bool
        Whether it is a force that is distributed over the undeformed top by `nodal`, and keeps its direction.
    loads_rim : bool
        Whether corners of a free top are loaded; the silicone at a corner may become unstable before the rest of the
        pad.
    indenter : Indenter or None
        The rigid body in contact: its displacement is the value, or follows from it as ``driven``.
    position : tuple of str
        Names of the two scene parameters that are its position along x and y, with respect to which readings have
        derivatives; empty without a position.
    self_contact : bool
        Whether paths continue where the pad touches itself, the board or obstacles, by frictionless contact; needs the
        package `ipctk`.

    Raises
    ------
    InputError
        if a parameter is not allowed, or ``self_contact`` is set and `ipctk` is not installed.
    """

    quantity: ClassVar[str]
    unit: ClassVar[str]
    components: ClassVar[int]
    bonded_plate: ClassVar[bool] = False
    tilts: ClassVar[bool] = False
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
        if self.self_contact:  # before a pad is meshed and loaded
            require_ipctk()

    @classmethod
    def quantities(cls) -> tuple[str, ...]:
        """Names of the scene parameters that together are the value."""
        return (cls.quantity, "moment") if cls.tilts else (cls.quantity,)

    @property
    def gives_displacement(self) -> bool:
        """Whether the value of the load is a displacement, so that the force is a reaction."""
        return self.unit == "mm"

    @property
    def moves_plate(self) -> bool:
        """Whether the displacement of a bonded plate is prescribed."""
        return self.bonded_plate and self.gives_displacement

    def pivot(self, mesh: VolumeMesh) -> np.ndarray:
        """Point of a tilting plate on which its force acts.

        Parameters
        ----------
        mesh : VolumeMesh
            Mesh of the undeformed pad.

        Returns
        -------
        (3,) ndarray
            The point in mm.
        """
        raise NotImplementedError(f"{self} does not tilt")

    def length(self, mesh: VolumeMesh) -> float:
        """Length by which moments are divided where they are compared with forces.

        Parameters
        ----------
        mesh : VolumeMesh
            Mesh of the undeformed pad.

        Returns
        -------
        float
            The length in mm.
        """
        raise NotImplementedError(f"{self} has no moments")

    @property
    def moved_indenter(self) -> Indenter | None:
        """The indenter if its displacement is prescribed; otherwise None."""
        return self.indenter if self.gives_displacement else None

    @property
    def driven(self) -> Load | None:
        """The load that prescribes the displacement of the same indenter; None if this load is no force on an indenter.
        """
        return None

    @property
    def has_position(self) -> bool:
        """Whether the load has a position on the pad, with respect to which states have derivatives."""
        return self.indenter is not None and not self.indenter.body.unbounded

    @property
    def area(self) -> float | None:
        """Area in mm² over which a force is spread, if it does not depend on the pad; else None."""
        return None

    @property
    def where(self) -> str:
        """Name of the loaded region for messages, such as "on a corner of the top"."""
        return "the top"

    def check(self, value: Sequence[float] | np.ndarray) -> None:
        """Raise `InputError` for a value that this load cannot have."""

    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """Area (N,) in mm² of each node on which a dead force acts."""
        raise NotImplementedError(f"{self} is not spread over nodes")

    def loaded_area(self, mesh: VolumeMesh) -> float:
        """Undeformed area in mm² on which the force acts; raises `InputError` if there is none."""
        return float(face_areas(mesh, top_faces(mesh)).sum())

    def is_symmetric(self, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
        """Whether the load is distributed symmetrically about a mirror of the mesh. ``image`` (N,) is the mirror image
        of each node.
        """
        return True if self.indenter is None else self.indenter.body.keeps(mirror)

    @classmethod
    def why_no_first_contact(cls, change: np.ndarray) -> str:
        """Reason why the load at which the pad first touches itself, the board or a package cannot be computed.

        Parameters
        ----------
        change : (n,) ndarray
            Direction in which the n components of the load grow.

        Returns
        -------
        str
            The reason; empty if the load can be computed.
        """
        return ""

    @classmethod
    def own_parameters(cls) -> Mapping[str, Parameter]:
        return parameters_of(cls)

    @classmethod
    def of_scene(cls, pad: Any, find: Any, **about: Any) -> Load:
        """Create the load from the parameters ``pad`` of a `deformable_pad`.

        ``find`` returns the path of a file that the parameters name. ``about`` has other attributes of the load, such
        as whether it is given in the frame of the pad.
        """
        parameters = {name: getattr(pad, cls.prefix + name) for name in cls.own_parameters()}
        return cls(**parameters, **about)

    def scene_values(self) -> dict[str, Any]:
        """Values of the parameters of the load in a scene, without ``self_contact``."""
        return {f"{self.prefix}{name}": value for name, value in values_of(self).items()}


@dataclass(frozen=True)
class DeadForce(Load):
    """A total force that is spread over the undeformed top, or a region of it, and keeps its direction (a dead load).
    """

    quantity = "force"
    unit = "N"
    components = 3
    dead = True
    has_position = True
    uses: ClassVar[tuple[str, ...]] = ("force",)

    @abstractmethod
    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """Loaded area that belongs to each node: the integral of the node's shape function over the loaded region.

        Only ratios of the areas are used, so they may be weighted. They must change continuously with the points of the
        mesh, because derivatives with respect to shapes and positions are computed from their differences.

        Parameters
        ----------
        mesh : VolumeMesh
            Mesh of the undeformed pad.

        Returns
        -------
        (N,) ndarray
            Areas in mm²; 0 for nodes on which no force acts.
        """

    def loaded_area(self, mesh: VolumeMesh) -> float:
        area = float(self.nodal(mesh).sum())
        if not area > 0:
            raise InputError(
                f"{self} is not allowed: it lies outside the top of the pad; a position over the top is needed."
            )
        return area

    def is_symmetric(self, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
        nodal = self.nodal(mesh)
        return bool(np.allclose(nodal[image], nodal, rtol=0, atol=1e-12 * nodal.max(initial=0.0)))


def normal_part(value: np.ndarray) -> np.ndarray:
    """Component of a load's value along z, other components being 0; a pressure is returned unchanged.

    Parameters
    ----------
    value : (c,) ndarray
        Value of the load.

    Returns
    -------
    (c,) ndarray
        The value with all other components 0.
    """
    part, axis = np.zeros(len(value)), min(2, len(value) - 1)
    part[axis] = value[axis]
    return part


def mirrored_value(mirror: Mirror, values: np.ndarray) -> np.ndarray:
    """Values of a load after reflection in a mirror: forces are vectors, moments axial vectors.

    Parameters
    ----------
    mirror : Mirror
        The mirror.
    values : (..., c) ndarray
        Values of a load with c components.

    Returns
    -------
    (..., c) ndarray
        The reflected values.
    """
    if values.shape[-1] == 1:
        return values
    parts = [mirror.image(values[..., :3])]
    if values.shape[-1] > 3:
        parts.append(0.0 - mirror.image(values[..., 3:]))
    return np.concatenate(parts, axis=-1)


def top_faces(mesh: VolumeMesh) -> np.ndarray:
    """Nodes (B, 6) of the faces of the top."""
    return mesh.faces[mesh.face_region == REGIONS["top"]]


def face_areas(mesh: VolumeMesh, faces: np.ndarray) -> np.ndarray:
    """Area of each of B flat faces.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    faces : (B, 6) ndarray of int
        Nodes of the faces.

    Returns
    -------
    (B,) ndarray
        Areas in mm².
    """
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
