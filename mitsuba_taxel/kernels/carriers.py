"""Shapes that carry LEDs and phototransistors: a `photo_reflector` carries a grid of faces, a `rectangle` a single
face."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_package
from mitsuba_taxel.kernels.taxels.faces import FaceGrid
from mitsuba_taxel.kernels.taxels.windows import NoWindow, Window

PLUGINS = {"led": "annular_led", "phototransistor": "phototransistor"}
"""The plugin of each kind of face, for messages."""


def faces_on(shape: mi.Shape, name: str, size: tuple[float, float]) -> FaceGrid:
    """The faces of LEDs or phototransistors on a shape.

    Parameters
    ----------
    shape : mi.Shape
        A `photo_reflector` or a `rectangle`.
    name : str
        ``led`` or ``phototransistor``.
    size : tuple[float, float]
        Extent of a face, mm.

    Returns
    -------
    FaceGrid
        The faces.

    Raises
    ------
    InputError
        if there is no shape, if it is neither a `photo_reflector` nor a `rectangle`, or if a face does not fit on it.
    """
    if shape is None:
        raise InputError(f"{PLUGINS[name]}: it must be nested in a rectangle or a photo_reflector.")
    if is_package(shape):
        return shape.face_grid(name)
    if shape.class_name() != "Rectangle":
        raise InputError(
            f"{PLUGINS[name]}: it must be nested in a rectangle or a photo_reflector, not in a {shape.class_name()}."
        )
    return _face_on_rectangle(matrix_of(shape), shape.has_flipped_normals(), name, size)


def matrix_of(shape: mi.Shape) -> np.ndarray:
    """Matrix that converts the coordinates of a shape to world coordinates, for shapes with a parameter ``to_world``,
    such as a rectangle.

    Entries are read individually: gathering them into an array would launch a kernel, a different kernel for each
    position, and no kernel can run while another is recorded.

    Parameters
    ----------
    shape : mi.Shape
        Shape with a parameter ``to_world``.

    Returns
    -------
    (4, 4) ndarray
        Matrix of the transformation in homogeneous coordinates.
    """
    rows = mi.traverse(shape)["to_world"].matrix
    return np.array([[rows[i][j].numpy()[0] for j in range(4)] for i in range(4)], dtype=float)


def _face_on_rectangle(matrix: np.ndarray, flipped: bool, name: str, size: tuple[float, float]) -> FaceGrid:
    """The face at the centre of a rectangle, with the normal of the rectangle."""
    half = np.linalg.norm(matrix[:3, :2], axis=0)
    axes = matrix[:3, :2] / half
    if abs(axes[:, 0] @ axes[:, 1]) > 1e-5:
        raise InputError(f"{PLUGINS[name]}: the rectangle that carries it is sheared; its sides must be perpendicular.")
    if any(extent > 2 * h * (1 + 1e-5) for extent, h in zip(size, half, strict=True)):
        raise InputError(
            f"{PLUGINS[name]}: {size[0]:g} x {size[1]:g} mm do not fit on its rectangle, {2 * half[0]:g} x "
            f"{2 * half[1]:g} mm: scale the rectangle up."
        )
    normal = np.linalg.inv(matrix[:3, :3]).T[:, 2]
    normal /= np.linalg.norm(normal) * (-1 if flipped else 1)
    rigid = np.eye(4)
    rigid[:3, 0], rigid[:3, 1], rigid[:3, 2] = axes[:, 0], np.cross(normal, axes[:, 0]), normal
    rigid[:3, 3] = matrix[:3, 3]
    return FaceGrid(mi.ScalarTransform4f(rigid), (0, 0, 0), size)


def window_on(shape: mi.Shape, name: str, faces: FaceGrid) -> Window:
    """The windows above the dies of LEDs or phototransistors.

    Parameters
    ----------
    shape : mi.Shape
        Shape that carries the dies.
    name : str
        ``led`` or ``phototransistor``.
    faces : FaceGrid
        Positions of the dies.

    Returns
    -------
    Window
        `NoWindow` for dies without windows.
    """
    return (shape.window(name, faces) if is_package(shape) else None) or NoWindow(faces)
