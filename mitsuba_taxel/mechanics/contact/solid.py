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
    """A closed surface, whose lowest point is at z = 0.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray
        Rows of their vertices, counter-clockwise seen from outside.
    distance : SolidDistance
        Signed distance from the surface.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    distance: SolidDistance


def content_of(file: str) -> bytes:
    """The bytes of a file of triangles; raises `InputError` if it has another format, is too large or unreadable."""
    path = Path(file)
    if path.suffix.lower() not in SURFACE_FORMATS:
        allowed = ", ".join(SURFACE_FORMATS)
        raise InputError(f"indenter_file = {file} is not allowed: a file that ends in one of {allowed} is needed.")
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"indenter_file = {file} is not allowed: at most {MOST_BYTES // 2**20} MB can be read.")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"indenter_file = {file} cannot be read ({error.strerror or error}).") from error


@kept(4)
def solid_in(file: str, digest: str, tilt: float, placement: Placement) -> Solid:
    """The body that a file contains.

    Parameters
    ----------
    file : str
        Path of a file of triangles.
    digest : str
        SHA-256 of the content that the file had when it was opened.
    tilt : float
        Angle of the tilt in degrees, about the axis along y at x = 0 and the lowest height.
    placement : Placement
        Unit and direction of the file.

    Returns
    -------
    Solid
        The tilted body, in mm.

    Raises
    ------
    InputError
        if the file cannot be read, has changed, or holds no closed surface.
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
