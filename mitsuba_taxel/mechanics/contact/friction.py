"""Coulomb friction of a rigid indenter on faces in contact.

At each node in contact, the tangential traction follows the slip, integrated like gaps, with the stiffness of the
pressure, and is at most the coefficient times the pressure: a return mapping as in plasticity, from the traction at the
end of the step before (P. Wriggers, Computational Contact Mechanics, 2006, section 10.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.contact.indentation import Indentation, Pressing

TINY = np.finfo(float).tiny


class Rubbed(NamedTuple):
    """History variables of friction.

    Attributes
    ----------
    place : (m, 3) ndarray
        Position of the faces relative to the indenter, integrated with the linear function of each node, mm³.
    traction : (m, 3) ndarray
        MPa, on the faces.
    """

    place: np.ndarray
    traction: np.ndarray


class Friction:
    """Friction at the nodes of an indenter's contact faces.

    Parameters
    ----------
    mirrors : sequence of Mirror
        Of a symmetric part; on their planes, nothing moves across.
    """

    def __init__(self, body: Indentation, places: np.ndarray, mirrors: Sequence[Mirror]) -> None:
        self._body, self.coefficient = body, body.indenter.friction
        on = np.array([mirror.side(places[body.node]) == 0 for mirror in mirrors], dtype=bool).reshape(
            -1, len(body.node)
        )
        self._walls = on.sum(axis=0)
        normals = np.array([[*mirror.normal, 0.0] for mirror in mirrors]).reshape(-1, 3)
        self._wall = normals[on.argmax(axis=0)] if len(normals) else np.zeros((len(body.node), 3))
        self._rows = [sparse.kron(body.carried, np.eye(3)[axis : axis + 1], format="csr") for axis in range(3)]

    def at_rest(self) -> Rubbed:
        """History of a pad that nothing has touched."""
        return Rubbed(*np.zeros((2, len(self._body.node), 3)))

    def place(self, displacement: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(m, 3) mm³, as in :class:`Rubbed`."""
        return self._body.carried @ displacement - self._body.area[:, None] * moved

    def tangents(self, pressing: Pressing) -> np.ndarray:
        """(m, 2, 3) unit vectors along the surface of the indenter; 0 across the planes of mirrors."""
        normal = pressing.lift / np.maximum(np.linalg.norm(pressing.lift, axis=1), TINY)[:, None]
        along = np.where(np.abs(normal[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        first = np.where((self._walls == 1)[:, None], np.cross(self._wall, normal), along)
        first = first - (first * normal).sum(axis=1)[:, None] * normal
        first /= np.maximum(np.linalg.norm(first, axis=1), TINY)[:, None]
        first[self._walls > 1] = 0.0
        second = np.cross(normal, first)
        second[self._walls > 0] = 0.0
        return np.stack([first, second], axis=1)

    def rows(self, tangents: np.ndarray) -> sparse.csr_array:
        """(2 m, 3 N) derivatives of the slip along the first tangents, then the second, by displacements."""
        x, y, z = (np.concatenate([tangents[:, 0, axis], tangents[:, 1, axis]]) for axis in range(3))
        both = [sparse.csr_array(sparse.vstack([rows, rows])) for rows in self._rows]
        return sparse.csr_array(
            both[0].multiply(x[:, None]) + both[1].multiply(y[:, None]) + both[2].multiply(z[:, None])
        )

    def slip(self, tangents: np.ndarray, place: np.ndarray, before: Rubbed) -> np.ndarray:
        """(m, 2) mm³ along the tangents since ``before``, less the elastic part due to the change of traction."""
        slack = self._body.slack[:, None]
        return np.einsum("mki,mi->mk", tangents, place - before.place - slack * before.traction)

    def traction(self, tangents: np.ndarray, place: np.ndarray, before: Rubbed, pressure: np.ndarray) -> np.ndarray:
        """(m, 3) MPa at the end of a step."""
        tried = -self.slip(tangents, place, before) / self._body.slack[:, None]
        most = self.coefficient * pressure
        size = np.linalg.norm(tried, axis=1)
        kept = most / np.maximum(size, np.maximum(most, TINY))
        return np.einsum("mki,mk->mi", tangents, kept[:, None] * tried)
