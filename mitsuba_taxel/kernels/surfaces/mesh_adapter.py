"""The only place that touches the interface of ``mi.Mesh``, which changes between Mitsuba releases."""

from __future__ import annotations

from typing import NamedTuple

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets


class Places(NamedTuple):
    """Vertices of a mesh, with normals.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        World coordinates.
    normals : (V, 3) ndarray or None
        Unit normals that triangles interpolate, None for flat triangles.
    region : (T,) ndarray or None
        Region codes of the triangles, where these depend on the places; None if not.
    """

    vertices: np.ndarray
    normals: np.ndarray | None
    region: np.ndarray | None = None


def initialize_mesh(mesh: mi.Mesh, props: mi.Properties, places: Places, triangles: np.ndarray) -> None:
    """Call ``mi.Mesh.__init__`` on a Python subclass under construction, and set its geometry.

    Parameters
    ----------
    mesh : mi.Mesh
        Under construction.
    props : mi.Properties
        Of the plugin.
    places : Places
        Of the vertices, mm.
    triangles : (T, 3) ndarray
        Int, counter-clockwise seen from outside.
    """
    smooth = places.normals is not None
    props["face_normals"] = not smooth
    counts = (len(places.vertices), len(triangles))
    mi.Mesh.__init__(mesh, props.id() or props.plugin_name(), *counts, props=props, has_vertex_normals=smooth)
    give_geometry(mesh, places, triangles)


def give_geometry(mesh: mi.Mesh, places: Places, triangles: np.ndarray) -> None:
    """Set the geometry of a mesh allocated for as many vertices and triangles.

    Parameters
    ----------
    mesh : mi.Mesh
        The allocated one.
    places : Places
        Of the vertices, mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    """
    parameters = mi.traverse(mesh)
    parameters["faces"] = in_packets(triangles, np.uint32)
    move_vertices(mesh, places)


def places_of(mesh: mi.Mesh) -> Places:
    """The present vertices of a mesh.

    Parameters
    ----------
    mesh : mi.Mesh
        An initialised one.

    Returns
    -------
    Places
        In mm.
    """
    parameters = mi.traverse(mesh)
    vertices, normals = (np.array(parameters[f"vertex_{name}"]).reshape(-1, 3) for name in ("positions", "normals"))
    return Places(vertices, normals if len(normals) else None)


def move_vertices(mesh: mi.Mesh, places: Places) -> None:
    """Set new vertices of an initialised mesh, as many as before; triangles are unchanged.

    Parameters
    ----------
    mesh : mi.Mesh
        The initialised one.
    places : Places
        Of the vertices, mm.
    """
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = in_packets(places.vertices)
    parameters.update()
    if places.normals is not None:  # after the positions, from which Mitsuba computes its own normals
        parameters["vertex_normals"] = in_packets(places.normals)
        parameters.update()
    if places.region is not None and "face_region" in parameters:  # not before the attribute is added
        parameters["face_region"] = in_packets(places.region)
        parameters.update()


def add_face_attribute(mesh: mi.Mesh, name: str, values: np.ndarray) -> None:
    """Attach a number to each triangle, readable as ``si.shape.eval_attribute_1('face_' + name, si)``.

    Parameters
    ----------
    mesh : mi.Mesh
        With T triangles.
    name : str
        Without the prefix ``face_``.
    values : (T,) ndarray
        One for each triangle.
    """
    mesh.add_attribute(f"face_{name}", 1, np.ravel(values).tolist())  # Mitsuba takes arrays apart number by number


def add_vertex_attribute(mesh: mi.Mesh, name: str, values: np.ndarray) -> None:
    """Attach a number to each vertex, as :func:`add_face_attribute` does to triangles.

    Parameters
    ----------
    mesh : mi.Mesh
        With V vertices.
    name : str
        Without the prefix ``vertex_``.
    values : (V,) ndarray
        One for each vertex.
    """
    mesh.add_attribute(f"vertex_{name}", 1, np.ravel(values).tolist())
