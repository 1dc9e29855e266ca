"""Pairing of LEDs and phototransistors."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.faces import matrix_of
from mitsuba_taxel.kernels.protocols import has_faces, is_led, is_pad, is_phototransistor
from mitsuba_taxel.kernels.taxel_pair import TaxelPair

_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_CIRCLE = np.stack([np.cos(np.arange(64) * np.pi / 32), np.sin(np.arange(64) * np.pi / 32)], axis=1)


def taxels_of(scene: mi.Scene) -> list[TaxelPair]:
    """Pairs of LEDs and phototransistors, in the order of the scene.

    Raises
    ------
    InputError
        if an emitter is not an `annular_led`, a sensor not a `phototransistor`, or their numbers differ.
    """
    leds = scene.emitters()
    sensors = scene.sensors()
    for emitter in leds:
        if not is_led(emitter):
            raise InputError(f"every emitter must be an annular_led, not a {kind_of(emitter)}.", emitter)
    refuse_foreign_sensors(scene)
    counts = [sum(part.faces.count for part in parts) for parts in (leds, sensors)]
    if counts[0] != counts[1] or len(leds) != len(sensors):
        raise InputError(
            f"the scene holds {counts[0]} LEDs and {counts[1]} phototransistors: one of each for every taxel is needed."
        )
    return [TaxelPair(led, sensor) for led, sensor in zip(leds, sensors, strict=True)]


def refuse_foreign_sensors(scene: mi.Scene) -> None:
    """Raise an InputError unless a scene has emitters and phototransistors, and no sensors of other kinds."""
    emitters, sensors = scene.emitters(), scene.sensors()
    for sensor in sensors:
        if not is_phototransistor(sensor):
            raise InputError(f"every sensor must be a phototransistor, not a {kind_of(sensor)}.", sensor)
    if not emitters or not sensors:
        raise InputError(
            f"the scene holds {len(emitters)} LEDs and {len(sensors)} phototransistors: at least one of each is needed."
        )


def refuse_shared_places(scene: mi.Scene) -> None:
    """Raise an InputError if another surface overlaps an LED or a phototransistor, in its plane and facing alike.

    It would be undefined which of the two a ray hits. One that faces the other way, such as a plate in contact, is
    allowed: no light passes between the two.
    """
    ends = [(end, end.window.faces) for end in (*scene.emitters(), *scene.sensors()) if has_faces(end)]
    surfaces = [(shape, *_triangles_of(shape)) for shape in scene.shapes() if not is_pad(shape)]
    for end, faces in ends:
        for shape, vertices, triangles in surfaces:
            if shape.ptr != end.get_shape().ptr and _lie_on(faces, vertices, triangles):
                raise InputError(
                    f"{kind_of(end)}: the {kind_of(shape)} {shape.id()!r} lies in its plane and overlaps it, so that "
                    "light would hit either: move or shrink one of them.",
                    end,
                )


def _triangles_of(shape: mi.Shape) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 3) in the world and triangles (K, 3) of a shape; none of one that is neither flat nor a mesh."""
    kind = shape.class_name()
    if kind in ("Rectangle", "Disk"):
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
    """Whether one of the triangles (K, 3) of some vertices overlaps any of ``faces``, in their plane, facing alike."""
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
    alike = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0] > 0
    corners, sides = corners[alike], sides[alike]
    # Separating axis theorem for two convex outlines.
    normals = np.concatenate([np.broadcast_to(np.eye(2), (len(sides), 2, 2)), sides @ [[0, 1], [-1, 0]]], axis=1)
    spans = np.einsum("kni,kci->knc", normals, corners)
    reach = np.abs(normals) @ half
    slack = 1e-5 * reach
    for middle in centres[:, :2] if len(corners) else ():
        place = normals @ middle
        apart = (spans.min(axis=2) > place + reach - slack) | (spans.max(axis=2) < place - reach + slack)
        if not apart.any(axis=1).all():
            return True
    return False
