"""Smooth contact pressures from those that hold an indenter, which scatter from node to node.

The value at a node is that of the parabola that fits best around it, on the faces that share a node with its own: patch
recovery as of stresses (O. C. Zienkiewicz and J. Z. Zhu, Int. J. Numer. Methods Eng. 33, 1992).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.contact.indentation import Indentation

TINY = np.finfo(float).tiny


def smooth_pressure(body: Indentation, pressure: np.ndarray) -> np.ndarray:
    """(m,) MPa, not negative, 0 where ``pressure`` (m,) is, and with its integral over the undeformed faces."""
    pressed = np.flatnonzero(pressure > 0)
    near = _neighbours(body)[pressed][:, pressed]
    found = np.zeros(len(pressure))
    for node, start, end in zip(pressed, near.indptr[:-1], near.indptr[1:], strict=True):
        around = pressed[near.indices[start:end]]
        terms = _parabola(body.places[around] - body.places[node])
        weight = np.sqrt(body.area[around])
        value = np.linalg.lstsq(terms * weight[:, None], weight * pressure[around], rcond=None)[0][0]
        found[node] = max(value, 0.0)
    return found * (body.area @ pressure / max(body.area @ found, TINY))


def _neighbours(body: Indentation) -> sparse.csr_array:
    """(m, m) that is not 0 for nodes of the same face, or of two faces that share a node."""
    faces, nodes = np.repeat(np.arange(len(body.faces)), 6), body.numbers.ravel()
    of_faces = sparse.coo_array((np.ones(len(nodes)), (faces, nodes)), shape=(len(body.faces), len(body.node))).tocsr()
    touching = of_faces.T @ of_faces
    return sparse.csr_array(touching @ touching)


def _parabola(apart: np.ndarray) -> np.ndarray:
    """(n, 6) monomials of places (n, 3), along the two axes over which they spread most."""
    axes = np.linalg.svd(apart - apart.mean(axis=0))[2][:2]
    x, y = axes @ apart.T / max(np.abs(apart).max(), TINY)
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
