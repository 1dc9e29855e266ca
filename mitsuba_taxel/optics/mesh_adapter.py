"""The only place that touches the interface of ``mi.Mesh``, which changes between Mitsuba releases."""

from __future__ import annotations

import mitsuba as mi
import numpy as np


def initialize_mesh(mesh: mi.Mesh, props: mi.Properties, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Call ``mi.Mesh.__init__`` on a half-built Python mesh and give it its geometry, with flat normals.

    Parameters
    ----------
    vertices : (V, 3) float, world coordinates
    triangles : (T, 3) int, counter-clockwise seen from outside
    """
    props["face_normals"] = True
    mi.Mesh.__init__(mesh, props.id() or props.plugin_name(), len(vertices), len(triangles), props=props)
    parameters = mi.traverse(mesh)
    parameters["faces"] = np.ascontiguousarray(triangles, dtype=np.uint32).ravel()
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, dtype=np.float32).ravel()
    parameters.update()


def move_vertices(mesh: mi.Mesh, vertices: np.ndarray) -> None:
    """Give an initialised mesh new (V, 3) vertex positions, the triangles staying as they are."""
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, dtype=np.float32).ravel()
    parameters.update()


def add_face_attribute(mesh: mi.Mesh, name: str, values: np.ndarray) -> None:
    """Attach a number to each triangle, readable as ``si.shape.eval_attribute_1('face_' + name, si)``."""
    mesh.add_attribute(f"face_{name}", 1, np.ravel(values).tolist())  # Mitsuba takes arrays apart number by number
