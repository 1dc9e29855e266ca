"""Read a surface of triangles from an STL, PLY or OBJ file."""

from __future__ import annotations

import io
import logging
import warnings

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.pads.imported.placement import UNMOVED, Placement
from mitsuba_taxel.pads.parametric.meshing import MOST_ELEMENTS

MOST_TRIANGLES = 300_000
VOLUME_TOLERANCE = 0.02
"""Relative difference between the volumes of mesh and pad above which the mesh is rejected."""


def read_surface(content: bytes, suffix: str, placement: Placement = UNMOVED) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of an STL, PLY or OBJ file, placed and not repaired.

    Parameters
    ----------
    content : bytes
        Content of the file.
    suffix : str
        Ending of the file's name in small letters, with the dot.
    placement : Placement
        Placement by which it is scaled, turned and moved.

    Returns
    -------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.

    Raises
    ------
    GeometryError
        if the content is not of that format, is cut short, holds numbers that are not finite, more than
        :data:`MOST_TRIANGLES` triangles, or none, or cannot be in mm.
    """
    if suffix == ".stl":
        _check_header(content)
    vertices, triangles = _parse(content, suffix)
    if not len(triangles):
        raise GeometryError(f"it holds no triangles of the format {suffix[1:].upper()}")
    if len(triangles) > MOST_TRIANGLES:
        raise GeometryError(f"it has {len(triangles)} triangles; at most {MOST_TRIANGLES} can be meshed: simplify it")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise GeometryError("a triangle refers to a missing vertex; export it again")
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], triangles.reshape(-1, 3)
    if not np.all(np.isfinite(vertices)):
        raise GeometryError(
            f"the coordinates of vertex {used[np.argmin(np.isfinite(vertices).all(axis=1))] + 1} are not finite; "
            "export it again"
        )
    return placement.placed(vertices), triangles


def _check_header(content: bytes) -> None:
    """Refuse a binary STL whose number of triangles does not fit its length, before reading it."""
    if content[:512].lstrip().lower().startswith(b"solid") and b"facet" in content[:1024].lower():
        return
    if len(content) < 84:
        raise GeometryError(f"it is no STL: {len(content)} bytes are less than a header; export it again")
    count = int.from_bytes(content[80:84], "little")
    if len(content) != 84 + 50 * count:
        raise GeometryError(
            f"it is no STL, or cut short: its header announces {count} triangles, for which it has the wrong length; "
            "export "
            "it again"
        )


def _parse(content: bytes, suffix: str) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    log = logging.getLogger("trimesh")
    level = log.level
    try:
        log.setLevel(logging.CRITICAL)  # it writes tracebacks about textures
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            # Without a resolver no other file, such as a texture, is opened.
            mesh = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:], process=False)
            return np.array(mesh.vertices, dtype=float).reshape(-1, 3), np.array(mesh.faces, dtype=np.int64).reshape(
                -1, 3
            )
    except Exception as error:  # readers may raise anything on a broken file
        raise GeometryError(
            f"it cannot be read as {suffix[1:].upper()} ({' '.join(str(error).split())[:100]}); export it again"
        ) from error
    finally:
        log.setLevel(level)


def check_mesh_size(mesh_size: float, volume: float) -> None:
    """Refuse more elements than fit in memory.

    Parameters
    ----------
    mesh_size : float
        Length of the edges of elements, mm.
    volume : float
        Volume of the pad, mm³.

    Raises
    ------
    InputError
        if the size is too small.
    """
    smallest = (8 * volume / MOST_ELEMENTS) ** (1 / 3)
    if mesh_size < smallest:
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: at least {smallest:.2g} is needed for this pad.")
