"""Change of the load up to the first contact of a pad with itself, the board or a package."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.bezier_patches import Place
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest

NEAR = 0.2
"""Distance from the point of contact within which faces are tested, relative to the height of the pad."""
FIRST = 1e-4
"""Largest movement of a node in the first step of the search, relative to the height of the pad."""
DOUBLINGS, HALVINGS = 12, 12
"""Number of doublings of the searched interval until it contains a contact, and of halvings after that: a nearby
contact is found to 2.5e-8 of the height."""


class ContactAhead:
    """Search for the load at which a deformed pad first touches itself, the board or a package; its nodes are assumed
    to move in straight lines.

    Parameters
    ----------
    displacement, rate : (N, 3) ndarray
        Displacement of the nodes in mm, and its derivative with respect to the load.
    point : Place
        Expected point of contact in the deformed pad, mm.
    """

    def __init__(self, mesh: VolumeMesh, displacement: np.ndarray, rate: np.ndarray, point: Place) -> None:
        self._mesh, self._displacement, self._rate = mesh, displacement, rate
        self.height = float(np.ptp(mesh.points[:, 2]))
        distance = np.linalg.norm((mesh.points + displacement)[mesh.faces] - point, axis=2).min(axis=1)
        self._near = np.unique(mesh.faces[distance < NEAR * self.height])

    def after(self, moved: np.ndarray, displaced: np.ndarray, packages: np.ndarray | None) -> float:
        """Increase of the load at which the pad first touches something, extrapolated from the movement of its nodes in
        a small step.

        Parameters
        ----------
        moved : (N, 3) ndarray
            Movement of the undeformed nodes, mm.
        displaced : (N, 3) ndarray
            Additional displacement of the nodes, mm.
        packages : (K, 3, 3) ndarray or None
            Corners of the triangles of packages, mm; if None, contact with the pad itself and the board is sought.

        Returns
        -------
        float
            Increment of the load, which may be negative; infinite without a contact nearby.
        """
        test = ContactTest(replace(self._mesh, points=self._mesh.points + moved), packages, self._near)
        find = test.find if packages is None else test.find_package

        def touches(change: float) -> bool:
            return find(self._displacement + displaced + change * self._rate) is not None

        step = FIRST * self.height / float(np.linalg.norm(self._rate, axis=1).max())
        free, touching = -step, step
        for _ in range(DOUBLINGS):
            if touches(free):
                free, touching = 2 * free, free
            elif not touches(touching):
                free, touching = touching, 2 * touching
            else:
                break
        else:
            return float("inf")
        for _ in range(HALVINGS):
            middle = 0.5 * (free + touching)
            free, touching = (free, middle) if touches(middle) else (middle, touching)
        return 0.5 * (free + touching)
