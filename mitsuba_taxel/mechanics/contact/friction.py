"""Coulomb friction of a rigid indenter on faces in contact.

At each node in contact, the tangential traction grows with the slip, at the penalty stiffness of the pressure, up to
the coefficient times the pressure. Slip is weighted and integrated over the faces like gaps. This is a return mapping
as in plasticity, from the traction at the end of the previous step (P. Wriggers, Computational Contact Mechanics, 2006,
section 10.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.contact.indentation import ContactState, Indentation

TINY = np.finfo(float).tiny


class FrictionState(NamedTuple):
    """History variables of friction at the end of a step.

    Attributes
    ----------
    slip_position : (m, 3) ndarray
        Position of the faces relative to the indenter, times the linear function of each of m contact nodes and
        integrated over the faces, mm³.
    traction : (m, 3) ndarray
        Tangential traction on the faces at each contact node, MPa.
    """

    slip_position: np.ndarray
    traction: np.ndarray


class Friction:
    """Friction of a rigid indenter at the nodes of the faces that it may touch.

    Parameters
    ----------
    body : Indentation
        Contact of the indenter with the mesh of a part of the pad.
    points : (N, 3) ndarray
        Undeformed nodes of the part, mm.
    mirrors : sequence of Mirror
        Mirrors that bound the part; nodes on their planes do not move across them.
    """

    def __init__(self, body: Indentation, points: np.ndarray, mirrors: Sequence[Mirror]) -> None:
        self._body, self.coefficient = body, body.indenter.friction
        on_mirror = np.array([mirror.side(points[body.node]) == 0 for mirror in mirrors], dtype=bool).reshape(
            -1, len(body.node)
        )
        self._walls = on_mirror.sum(axis=0)
        normals = np.array([[*mirror.normal, 0.0] for mirror in mirrors]).reshape(-1, 3)
        self._wall = normals[on_mirror.argmax(axis=0)] if len(normals) else np.zeros((len(body.node), 3))
        self._rows = [sparse.kron(body.carried, np.eye(3)[axis : axis + 1], format="csr") for axis in range(3)]

    def at_rest(self) -> FrictionState:
        """Friction state of a pad that the indenter has not touched yet: zeros."""
        return FrictionState(*np.zeros((2, len(self._body.node), 3)))

    def slip_position(self, displacement: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Position (m, 3) of the pad's faces relative to the indenter, in mm³: weighted with the linear shape function
        of each of m contact nodes, and integrated over the faces; see :class:`FrictionState`.

        It follows from the ``displacement`` (N, 3) of the nodes and the displacement ``moved`` (3,) of the indenter, in
        mm.
        """
        return self._body.carried @ displacement - self._body.area[:, None] * moved

    def tangents(self, contact_state: ContactState) -> np.ndarray:
        """Two orthogonal unit vectors (m, 2, 3), tangential to the indenter, at each of m contact nodes. A vector that
        is normal to a plane of symmetry is replaced by 0, because the node cannot slide in this direction.
        """
        normal = (
            contact_state.area_normal / np.maximum(np.linalg.norm(contact_state.area_normal, axis=1), TINY)[:, None]
        )
        reference = np.where(np.abs(normal[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        first = np.where((self._walls == 1)[:, None], np.cross(self._wall, normal), reference)
        first = first - (first * normal).sum(axis=1)[:, None] * normal
        first /= np.maximum(np.linalg.norm(first, axis=1), TINY)[:, None]
        first[self._walls > 1] = 0.0
        second = np.cross(normal, first)
        second[self._walls > 0] = 0.0
        return np.stack([first, second], axis=1)

    def rows(self, tangents: np.ndarray) -> sparse.csr_array:
        """Derivative (2 m, 3 N), in mm², of the slip at m contact nodes with respect to the displacements of N nodes.
        The first m rows are for the slip along the first tangents, the others for the slip along the second tangents.
        """
        x, y, z = (np.concatenate([tangents[:, 0, axis], tangents[:, 1, axis]]) for axis in range(3))
        doubled = [sparse.csr_array(sparse.vstack([rows, rows])) for rows in self._rows]
        return sparse.csr_array(
            doubled[0].multiply(x[:, None]) + doubled[1].multiply(y[:, None]) + doubled[2].multiply(z[:, None])
        )

    def slip(self, tangents: np.ndarray, slip_position: np.ndarray, previous: FrictionState) -> np.ndarray:
        """Slip (m, 2) along both tangents since the ``previous`` state, integrated over the area of each of m contact
        nodes, in mm³.

        The elastic slip under the previous state's traction is not included."""
        compliance = self._body.slack[:, None]
        return np.einsum(
            "mki,mi->mk", tangents, slip_position - previous.slip_position - compliance * previous.traction
        )

    def traction(
        self, tangents: np.ndarray, slip_position: np.ndarray, previous: FrictionState, pressure: np.ndarray
    ) -> np.ndarray:
        """Tangential traction (m, 3) in MPa at m contact nodes at the end of a step, from the slip and the pressure.
        The step began with a ``previous`` state.
        """
        trial = -self.slip(tangents, slip_position, previous) / self._body.slack[:, None]
        limit = self.coefficient * pressure
        trial_size = np.linalg.norm(trial, axis=1)
        scale = limit / np.maximum(trial_size, np.maximum(limit, TINY))
        return np.einsum("mki,mk->mi", tangents, scale[:, None] * trial)
