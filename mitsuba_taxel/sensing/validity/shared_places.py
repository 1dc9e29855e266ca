"""Refusal of surfaces that lie in the same place, because it would be undefined which of them a ray hits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.carriers import matrix_of
from mitsuba_taxel.kernels.protocols import PadShape, has_faces, is_pad
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_CIRCLE = np.stack([np.cos(np.arange(64) * np.pi / 32), np.sin(np.arange(64) * np.pi / 32)], axis=1)
FLAT = ("Rectangle", "Disk")
"""Classes of Mitsuba's flat shapes."""
_ALIKE = 1e-5
"""Largest distance from a plane, relative to the size of the outlines in it, and largest angle between normals, in
rad."""


def refuse_shared_places(scene: mi.Scene) -> None:
    """Raise `InputError` for a surface that overlaps an LED or a phototransistor in its plane.

    It would be undefined which of the two a ray hits, and light would leave an LED through a surface that covers it. A
    plate that lies face down on all LEDs and phototransistors is allowed: then no light passes from any LED to any
    phototransistor.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Raises
    ------
    InputError
        if there is such a surface; the message names both.
    """
    ends = [(end, end.window.faces) for end in (*scene.emitters(), *scene.sensors()) if has_faces(end)]
    rigid = [shape for shape in scene.shapes() if not is_pad(shape)]
    uncovering = [shape for shape in rigid if not all(_is_lid(shape, faces) for _, faces in ends)]
    surfaces = [(shape, *_triangles_of(shape)) for shape in uncovering]
    for end, faces in ends:
        for shape, vertices, triangles in surfaces:
            if shape.ptr != end.get_shape().ptr and _lie_on(faces, vertices, triangles):
                raise InputError(
                    f"{kind_of(end)}: the {kind_of(shape)} {shape.id()!r} lies in its plane and overlaps it, so that "
                    "light would hit either: move or shrink one of them.",
                    end,
                )


def refuse_shared_planes(scene: mi.Scene) -> None:
    """Raise `InputError` for rectangles or disks with different BSDFs that overlap in one plane, and for pads that
    overlap in space.

    Shapes that carry an LED or a phototransistor are checked by `refuse_shared_places`.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Raises
    ------
    InputError
        if two shapes overlap; the message names both.
    """
    walls = (shape for shape in scene.shapes() if not (is_pad(shape) or shape.is_emitter() or shape.is_sensor()))
    flat = [shape for shape in walls if shape.class_name() in FLAT]
    outlines, bsdfs = [_outline(shape) for shape in flat], [shape.bsdf() for shape in flat]
    for i, j in _pairs_in_one_plane(outlines):
        if bsdfs[i] is not bsdfs[j] and _overlap(outlines[i], outlines[j]):
            first, second = flat[i], flat[j]
            raise InputError(
                f"the {kind_of(first)} {first.id()!r} and the {kind_of(second)} {second.id()!r} overlap in one plane: "
                "light would hit either, so move or shrink one of them.",
                second,
            )
    for pad, second_pad in combinations(deformed_pads(scene), 2):
        if not _boxes_separated(_box(pad), _box(second_pad)):
            raise InputError("two deformable_pads overlap in space: move one of them.", second_pad)


def _is_lid(shape: mi.Shape, faces: Any) -> bool:
    """Whether the front of a rectangle or disk is turned towards all of ``faces``, and would cover them all if it lay
    in their plane."""
    if shape.class_name() not in FLAT:
        return False
    matrix, frame = matrix_of(shape), faces.frame
    s, t, n = (np.array(axis, dtype=float).ravel() for axis in (frame.s, frame.t, frame.n))
    sign = -1 if shape.has_flipped_normals() else 1
    if not sign * np.linalg.inv(matrix[:3, :3])[2] @ n < 0:
        return False
    half = 0.5 * np.array(faces.size, dtype=float).ravel()
    corners = np.array(faces.centres, dtype=float).T[:, None] + _SQUARE * half @ np.stack([s, t])
    along = (corners - matrix[:3, 3]) @ np.linalg.pinv(matrix[:3, :2]).T
    reach = np.abs(along).max() if shape.class_name() == "Rectangle" else np.linalg.norm(along, axis=2).max()
    return bool(reach <= 1 + _ALIKE)


def _outline(shape: mi.Shape) -> np.ndarray:
    """The K corners (K, 3) of a rectangle, or of a polygon that represents a disk, in world coordinates."""
    return _triangles_of(shape)[0][:-1]


def _pairs_in_one_plane(outlines: Sequence[np.ndarray]) -> Iterator[tuple[int, int]]:
    """Indices of pairs of flat outlines, each an array (K, 3) of K corners, that may overlap: their planes coincide,
    and their bounding boxes meet."""
    if not outlines:
        return
    centres = np.array([outline.mean(axis=0) for outline in outlines])
    normals = np.array([_plane(outline)[1] for outline in outlines])
    low, high = (np.array([end(outline, axis=0) for outline in outlines]) for end in (np.min, np.max))
    size = np.array([np.linalg.norm(outline - outline.mean(axis=0), axis=1).max() for outline in outlines])
    for first in range(len(outlines) - 1):
        later = slice(first + 1, None)
        slack = 3 * _ALIKE * (size[first] + size[later]) + 1e-12
        candidate = np.all(low[later] <= high[first] + slack[:, None], axis=1)
        candidate &= np.all(high[later] >= low[first] - slack[:, None], axis=1)
        candidate &= np.abs(normals[later] @ normals[first]) >= 1 - 2 * _ALIKE
        candidate &= np.abs((centres[later] - centres[first]) @ normals[first]) <= slack
        yield from ((first, first + 1 + int(offset)) for offset in np.flatnonzero(candidate))


def _overlap(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two flat convex outlines, each an array (K, 3) of K corners, lie in one plane and overlap."""
    centre, (sides, normal) = first.mean(axis=0), _plane(first)
    size = max(np.abs(first - centre).max(), np.abs(second - centre).max())
    if np.abs((second - centre) @ normal).max() > _ALIKE * size or abs(_plane(second)[1] @ normal) < 1 - _ALIKE:
        return False
    flat = [(outline - centre) @ sides for outline in (first, second)]
    axes = np.concatenate([np.roll(corners, 1, axis=0) - corners for corners in flat]) @ [[0, 1], [-1, 0]]
    return not _separated(axes, *flat)


def _plane(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Plane of a flat outline: two unit vectors in it, as columns (3, 2), and its normal (3,)."""
    _, _, rows = np.linalg.svd(outline - outline.mean(axis=0))
    return rows[:2].T, rows[2]


def _box(pad: PadShape) -> tuple[np.ndarray, np.ndarray]:
    """Axes (3, 3) of the bounding box of an undeformed pad, and its eight corners (8, 3), in world coordinates."""
    axes = pad.to_world[:3, :3].T / np.cbrt(np.linalg.det(pad.to_world[:3, :3]))
    along = pad.undeformed.vertices @ axes.T
    corners = np.stack(np.meshgrid(*zip(along.min(axis=0), along.max(axis=0), strict=True)), axis=-1)
    return axes, corners.reshape(-1, 3) @ axes


def _boxes_separated(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> bool:
    """Whether two boxes, each given by axes and corners, do not overlap."""
    crossed = np.cross(first[0][:, None], second[0][None]).reshape(-1, 3)
    return _separated(np.concatenate([first[0], second[0], crossed]), first[1], second[1])


def _separated(axes: np.ndarray, first: np.ndarray, second: np.ndarray) -> bool:
    """Whether any of K axes (K, D) separates two convex bodies in D dimensions, each given by its corners (N, D)
    (separating axis theorem)."""
    axes = axes[np.linalg.norm(axes, axis=1) > _ALIKE * np.abs(axes).max()]
    (low, high), (bottom, top) = ((along.min(axis=0), along.max(axis=0)) for along in (first @ axes.T, second @ axes.T))
    slack = _ALIKE * (np.maximum(high, top) - np.minimum(low, bottom))
    return bool(np.any((low > top - slack) | (bottom > high - slack)))


def _triangles_of(shape: mi.Shape) -> tuple[np.ndarray, np.ndarray]:
    """N vertices (N, 3) in world coordinates, and K triangles (K, 3) as indices of vertices, of a flat shape or a mesh;
    empty for any other shape."""
    kind = shape.class_name()
    if kind in FLAT:
        to_world = matrix_of(shape)
        rim = _SQUARE if kind == "Rectangle" else _CIRCLE
        corners = np.concatenate([rim, np.zeros((1, 2))])
        here, centre = np.arange(len(rim)), np.full(len(rim), len(rim))
        triangles = np.stack([np.roll(here, 1), here, centre], axis=1)
        return corners @ to_world[:3, :2].T + to_world[:3, 3], triangles
    if not shape.is_mesh():
        return np.empty((0, 3)), np.empty((0, 3), dtype=int)
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    return vertices, np.array(parameters["faces"]).reshape(-1, 3)


def _lie_on(faces: Any, vertices: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether any of the triangles, given by ``vertices`` and the indices ``triangles`` (K, 3), lies in the plane of
    ``faces`` and overlaps one of them."""
    frame = np.column_stack([np.array(axis).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    half = 0.5 * np.array(faces.size, dtype=float).ravel()
    centres = np.array(faces.centres, dtype=float).T @ frame
    furthest = max(vertices.max(initial=0), -vertices.min(initial=0))
    step = 1e-5 * 2 * np.sqrt(half.prod()) + 3e-6 * furthest  # the offset of rays
    in_plane = np.abs(vertices @ frame[:, 2] - centres[0, 2]) <= step
    corners = vertices[triangles[in_plane[triangles].all(axis=1)]] @ frame[:, :2]
    low, high = centres.min(axis=0)[:2] - half, centres.max(axis=0)[:2] + half
    corners = corners[np.all((corners.min(axis=1) < high) & (corners.max(axis=1) > low), axis=1)]
    sides = np.roll(corners, -1, axis=1) - corners
    # Separating axis theorem for two convex outlines, a triangle and a face.
    normals = np.concatenate([np.broadcast_to(np.eye(2), (len(sides), 2, 2)), sides @ [[0, 1], [-1, 0]]], axis=1)
    spans = np.einsum("kni,kci->knc", normals, corners)
    reach = np.abs(normals) @ half
    slack = 1e-5 * reach
    for middle in centres[:, :2] if len(corners) else ():
        centre = normals @ middle
        separated = (spans.min(axis=2) > centre + reach - slack) | (spans.max(axis=2) < centre - reach + slack)
        if not separated.any(axis=1).all():
            return True
    return False
