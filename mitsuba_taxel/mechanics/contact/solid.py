"""Rigid bodies from files of triangles."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.mechanics.contact.solid_distance import SolidDistance
from mitsuba_taxel.pads.imported.placement import Placement
from mitsuba_taxel.pads.imported.surfaces import read_surface
from mitsuba_taxel.pads.imported.triangles.repair import repaired
from mitsuba_taxel.pads.pad_file import MOST_BYTES, SURFACE_FORMATS


class Solid(NamedTuple):
    """A closed surface, its lowest point at z = 0.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        In mm.
    triangles : (T, 3) ndarray
        Counter-clockwise seen from outside.
    distance : SolidDistance
        From it.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    distance: SolidDistance


def content_of(file: str) -> bytes:
    """What a file holds; raises `InputError` if that cannot be read."""
    path = Path(file)
    if path.suffix.lower() not in SURFACE_FORMATS:
        known = ", ".join(SURFACE_FORMATS)
        raise InputError(f"indenter_file = {file} is not allowed: a file that ends in one of {known} is needed.")
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"indenter_file = {file} is not allowed: at most {MOST_BYTES // 2**20} MB can be read.")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"indenter_file = {file} cannot be read ({error.strerror or error}).") from error


@kept(4)
def solid_in(file: str, digest: str, tilt: float, placement: Placement) -> Solid:
    """The body in a file that holds what it held when its ``digest`` was taken, tilted by degrees; raises `InputError`.

    It turns about y, at x = 0 and the lowest height.
    """
    content = content_of(file)
    if hashlib.sha256(content).hexdigest() != digest:
        raise InputError(f"indenter_file = {file} is not allowed: it has changed since it was opened.")
    try:
        vertices, triangles = repaired(*read_surface(content, Path(file).suffix.lower(), placement))
    except GeometryError as error:
        raise InputError(f"indenter_file = {file} is not allowed: {error}.") from error
    vertices = (vertices - [0.0, 0.0, vertices[:, 2].min()]) @ Rotation.from_euler("y", -tilt, degrees=True).as_matrix()
    vertices = vertices - [0.0, 0.0, vertices[:, 2].min()]
    return Solid(vertices, triangles, SolidDistance(vertices, triangles))
