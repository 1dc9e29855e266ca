"""Meshes of triangles without a pad, some with triangles that have no area."""

from __future__ import annotations

import numpy as np
from plate_scenes import BODY_TOP, WHITE, plate

from mitsuba_taxel import Scene


def mesh_of(mi, vertices, triangles, bsdf=WHITE, **attributes):
    """An ``mi.Mesh`` with flat normals; ``attributes`` are numbers of its faces."""
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf)
    props["face_normals"] = True
    mesh = mi.Mesh("mesh", len(vertices), len(triangles), props=props)
    parameters = mi.traverse(mesh)
    parameters["faces"] = np.asarray(triangles, dtype=np.uint32).ravel()
    parameters["vertex_positions"] = np.asarray(vertices, dtype=np.float32).ravel()
    parameters.update()
    for name, values in attributes.items():
        values = np.broadcast_to(np.asarray(values, dtype=np.float32), len(triangles))
        mesh.add_attribute(f"face_{name}", 1, np.ascontiguousarray(values))
    return mesh


def grid_of(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of [-1, 1]² at z = 0, which face +z."""
    line = np.linspace(-1, 1, cells + 1)
    x, y = np.meshgrid(line, line)
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), triangles


def with_degenerate(vertices: np.ndarray, triangles: np.ndarray, before: float):
    """Also triangles of one vertex, of two, of three on a line, and the same moved by ``before`` along z."""
    first, second, third = triangles.T
    count = len(vertices)
    middle = 0.5 * (vertices[first] + vertices[second])
    third_on_line = count + np.arange(len(triangles))
    flat = np.concatenate(
        [
            np.stack([first, first, first], axis=1),
            np.stack([first, second, second], axis=1),
            np.stack([first, third, first], axis=1),
            np.stack([first, second, third_on_line], axis=1),
        ]
    )
    vertices = np.concatenate([vertices, middle])
    return (
        np.concatenate([vertices, vertices + [0, 0, before]]),
        np.concatenate([triangles, flat, flat + len(vertices)]),
    )


def plate_mesh(mi, cells: int, degenerate: bool = False, bsdf=WHITE):
    """A plate 4 mm wide, 0.3 mm above the LED's plane and facing down, in 2 cells² triangles."""
    vertices, triangles = grid_of(cells)
    if degenerate:
        vertices, triangles = with_degenerate(vertices, triangles, before=0.05)
    return mesh_of(mi, vertices * [2, -2, -1] + [0, 0, BODY_TOP + 0.3], triangles, bsdf)


def domed_cell(mi, degenerate: bool) -> Scene:
    """A photo-reflector under half a sphere of radius 1.3 mm, open below, that is a pad's mesh to the guide."""
    square, triangles = grid_of(16)
    polar = 0.5 * np.pi * np.abs(square[:, :2]).max(axis=1)
    azimuth = np.arctan2(square[:, 1], square[:, 0])
    dome = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    if degenerate:
        dome, triangles = with_degenerate(dome, triangles, before=-0.1)
    cover = {"type": "region", "roof": {"type": "wall", "reflectance": 0.9}}
    mesh = mesh_of(mi, 1.3 * dome, triangles[:, ::-1], cover, region=1, cell=1)
    return Scene({**plate().source, "plate": mesh})
