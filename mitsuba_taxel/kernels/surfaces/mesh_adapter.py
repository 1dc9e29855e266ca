"""Access to ``mi.Mesh``, whose interface changes between Mitsuba releases; no other module uses that interface."""

from __future__ import annotations

from typing import NamedTuple

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets


class Places(NamedTuple):
    """Positions of V vertices of a mesh of T triangles, with their normals.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        World coordinates.
    normals : (V, 3) ndarray or None
        Unit normals, which triangles interpolate; None for flat triangles.
    region : (T,) ndarray or None
        Region codes of the triangles, if these depend on the deformation; None otherwise.
    """

    vertices: np.ndarray
    normals: np.ndarray | None
    region: np.ndarray | None = None


def initialize_mesh(
    mesh: mi.Mesh, props: mi.Properties, places: Places, triangles: np.ndarray, texcoords: np.ndarray | None = None
) -> None:
    """Call ``mi.Mesh.__init__`` on a Python subclass under construction, and set its geometry.

    Parameters
    ----------
    mesh : mi.Mesh
        The mesh under construction.
    props : mi.Properties
        Properties of the plugin.
    places : Places
        Vertices and normals.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle, counter-clockwise seen from outside.
    texcoords : (V, 2) ndarray, optional
        Texture coordinates of the vertices.
    """
    smooth = places.normals is not None
    props["face_normals"] = not smooth
    counts = (len(places.vertices), len(triangles))
    has = {"has_vertex_normals": smooth, "has_vertex_texcoords": texcoords is not None}
    mi.Mesh.__init__(mesh, props.id() or props.plugin_name(), *counts, props=props, **has)
    if texcoords is not None:
        parameters = mi.traverse(mesh)
        parameters["vertex_texcoords"] = in_packets(texcoords)
    give_geometry(mesh, places, triangles)


def give_geometry(mesh: mi.Mesh, places: Places, triangles: np.ndarray) -> None:
    """Set the geometry of a mesh that is allocated for the number of vertices and triangles.

    Parameters
    ----------
    mesh : mi.Mesh
        The mesh.
    places : Places
        Vertices and normals.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    """
    parameters = mi.traverse(mesh)
    parameters["faces"] = in_packets(triangles, np.uint32)
    move_vertices(mesh, places)


def places_of(mesh: mi.Mesh) -> Places:
    """The current positions and normals of the vertices of a mesh.

    Parameters
    ----------
    mesh : mi.Mesh
        An initialised mesh.

    Returns
    -------
    Places
        Vertices and normals.
    """
    parameters = mi.traverse(mesh)
    vertices, normals = (np.array(parameters[f"vertex_{name}"]).reshape(-1, 3) for name in ("positions", "normals"))
    return Places(vertices, normals if len(normals) else None)


def move_vertices(mesh: mi.Mesh, places: Places) -> None:
    """Move the vertices of an initialised mesh; their number and the triangles are unchanged.

    Parameters
    ----------
    mesh : mi.Mesh
        The mesh.
    places : Places
        New vertices and normals.
    """
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = in_packets(places.vertices)
    parameters.update()
    # Normals are set after the positions, from which Mitsuba computes its own normals.
    if places.normals is not None:
        parameters["vertex_normals"] = in_packets(places.normals)
        parameters.update()
    # A mesh under construction has no attributes yet.
    if places.region is not None and "face_region" in parameters:
        parameters["face_region"] = in_packets(places.region)
        parameters.update()


def add_face_attribute(mesh: mi.Mesh, name: str, values: np.ndarray) -> None:
    """Add a number for each triangle, which ``si.shape.eval_attribute_1('face_' + name, si)`` returns.

    Parameters
    ----------
    mesh : mi.Mesh
        Mesh with T triangles.
    name : str
        Name of the attribute without the prefix ``face_``.
    values : (T,) ndarray
        The numbers.
    """
    # A list, as Mitsuba reads arrays element by element.
    mesh.add_attribute(f"face_{name}", 1, np.ravel(values).tolist())


def add_vertex_attribute(mesh: mi.Mesh, name: str, values: np.ndarray) -> None:
    """Add a number for each vertex; see :func:`add_face_attribute`.

    Parameters
    ----------
    mesh : mi.Mesh
        Mesh with V vertices.
    name : str
        Name of the attribute without the prefix ``vertex_``.
    values : (V,) ndarray
        The numbers.
    """
    mesh.add_attribute(f"vertex_{name}", 1, np.ravel(values).tolist())
