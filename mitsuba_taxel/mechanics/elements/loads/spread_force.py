"""Load by a force that is spread over the whole top."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.loads.load import DeadForce, Load, face_areas, top_faces


@dataclass(frozen=True)
class SpreadForce(DeadForce, name="spread_force", rank=0):
    """A total force, spread evenly over the undeformed top; it keeps its direction (a dead load).

    Parameters
    ----------
    self_contact : bool
        Whether load paths continue, with contact without friction, after the pad touches itself, the board or
        obstacles.
    """

    meaning = "on the whole top"
    loads_rim = True
    has_position = False

    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """Loaded area (N,) in mm² of each node.

        The consistent load of a flat six-node triangle lies on its mid-edge nodes, a third of the area each.
        """
        top = top_faces(mesh)
        third = face_areas(mesh, top) / 3
        return np.bincount(top[:, 3:].ravel(), weights=np.repeat(third, 3), minlength=len(mesh.points))

    def loaded_area(self, mesh: VolumeMesh) -> float:
        return Load.loaded_area(self, mesh)

    def is_symmetric(self, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
        """True: the loaded region of the surface is as symmetric as the mesh.

        Parameters
        ----------
        mesh : VolumeMesh
            Mesh of the undeformed pad.
        mirror : Mirror
            A plane of symmetry of the mesh.
        image : (N,) ndarray of int
            The node that is the mirror image of each.

        Returns
        -------
        bool
            True.
        """
        return True


SPREAD_FORCE = SpreadForce()
