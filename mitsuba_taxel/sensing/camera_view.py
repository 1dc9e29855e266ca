"""View of a camera without light: for each pixel, the visible point of the pad's coat, with its depth, displacement and
contact pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.backend import activate_variant
from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.kernels.paths.taxel_integrators import traces_taxels
from mitsuba_taxel.kernels.protocols import PadShape, is_pad, is_phototransistor
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.parsing import parser_config
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi

REPLICATES = 16
"""Number of independent images from which the standard error follows."""
BYTES_PER_SAMPLE = 400
"""Memory in bytes per traced path, measured with scenes of a few plugins."""
BYTES_PER_PIXEL = 2 * 8 * 3 * REPLICATES
"""Memory in bytes per pixel for the images of all replicates, and their copy."""
FILM = 768, 576
"""Default width and height of films of Mitsuba, in pixels."""
MOST_SURFACES = 16
"""Largest number of clear surfaces through which the depth is measured."""


@dataclass(frozen=True, eq=False)
class View:
    """View of a camera: quantities at the centre of each pixel of an image, H pixels high and W wide.

    Attributes
    ----------
    camera : mi.Sensor
        The camera.
    depth : (H, W) ndarray
        Distance in mm, along the axis of the camera, from its plane to the first surface that is not clear; NaN without
        such a surface.
    coat : (H, W) ndarray of bool
        Whether that surface is the coat: the top of a pad without cells, seen from inside.
    displacement : (H, W, 3) ndarray
        Displacement of the coat by the load, in mm along x, y and z of the scene; NaN in other pixels.
    points : (H, W, 3) ndarray
        Place of the coat in mm in the scene; NaN in other pixels.
    contact_pressure : (H, W) ndarray or None
        Contact pressure of an indenter on the coat: force in MPa per area of the unloaded coat. NaN in other pixels;
        None without an indenter that touches.
    """

    camera: mi.Sensor
    depth: np.ndarray
    coat: np.ndarray
    displacement: np.ndarray
    points: np.ndarray
    contact_pressure: np.ndarray | None


def view_of(scene: mi.Scene) -> View:
    """Compute the view of a scene's camera; no light is traced.

    Parameters
    ----------
    scene : mi.Scene
        Loaded scene.

    Returns
    -------
    View
        The camera, and depth, coat, displacement and contact pressure at each pixel.

    Raises
    ------
    InputError
        if the scene's image cannot be computed; see `camera_image`.
    """
    camera = _camera_of(scene)
    _refuse_large(*map(int, camera.film().crop_size()))
    return _view(scene, camera)


def _camera_of(scene: mi.Scene) -> mi.Sensor:
    """The only camera of a scene whose image can be computed; raises `InputError`."""
    cameras = [sensor for sensor in scene.sensors() if not is_phototransistor(sensor)]
    if len(cameras) != 1 or len(scene.sensors()) != 1:
        raise InputError(
            f"the scene holds {len(cameras)} cameras and {len(scene.sensors()) - len(cameras)} phototransistors: a "
            "single camera is needed for an image."
        )
    integrator = scene.integrator()
    if integrator is None or traces_taxels(integrator):
        raise InputError(
            f"integrator {kind_of(integrator)} reads phototransistors, and makes no image of a camera: use one of "
            "Mitsuba's own, such as path.",
            integrator,
        )
    if integrator.aov_names():
        raise InputError(f"integrator {kind_of(integrator)} is not allowed: it renders no colours; use path.")
    if not scene.emitters():
        raise InputError("the scene holds no light: at least one emitter is needed.")
    return cameras[0]


def refuse_large_films(scene: Scene) -> None:
    """Refuse a scene whose film is so large that the image does not fit into the free memory. This is checked before
    anything is built or deformed.

    Parameters
    ----------
    scene : Scene
        Description of the scene.

    Raises
    ------
    InputError
        if there is such a film, or the description is refused.
    """
    import mitsuba as mi

    with scene.files_beside_it():
        try:
            nodes = scene.parsed(parser_config(activate_variant())).nodes
        except RuntimeError:  # Mitsuba's own, which is raised again when the scene is loaded
            return
    for film in (node.props for node in nodes if node.type == mi.ObjectType.Film):
        width, height = (film.get(name, default) for name, default in zip(("width", "height"), FILM, strict=True))
        sizes = film.get("crop_width", width), film.get("crop_height", height)
        if all(isinstance(size, int) for size in sizes):
            _refuse_large(*sizes)


def refuse_unseen(scene: Scene) -> None:
    """Refuse a scene whose image cannot be computed. The unloaded pads are checked, before any load is solved.

    Parameters
    ----------
    scene : Scene
        Description of the scene.

    Raises
    ------
    InputError
        as of `refuse_large_films` and `view_of`.
    """
    refuse_large_films(scene)
    try:
        at_rest = scene.load_at_rest()
    except (InputError, ComputationError):  # it is raised again, with all of its reason, when the scene is loaded
        return
    view_of(at_rest)


def _refuse_large(width: int, height: int) -> None:
    """Raise for a film whose image does not fit into the free memory."""
    from mitsuba_taxel.mechanics.elements.memory import free_memory

    needed, free = float(width) * height * (BYTES_PER_SAMPLE + BYTES_PER_PIXEL), free_memory()
    if needed > free:
        raise InputError(
            f"width = {width}, height = {height} of the film are not allowed: the image needs "
            f"{needed / 2**30:.3g} GiB, and {free / 2**30:.3g} GiB are free. Make it smaller."
        )


def _view(scene: mi.Scene, camera: mi.Sensor) -> View:
    """Trace a ray through the centre of each pixel of a camera, and collect the view of the coat.

    Rays pass through surfaces that only transmit light, and are refracted there. `InputError` is raised if no pixel
    shows the coat.
    """
    import drjit as dr
    import mitsuba as mi

    film = camera.film()
    width, height = map(int, film.crop_size())
    pixel = dr.arange(mi.UInt32, width * height)
    place = (mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width)) + 0.5) / mi.Vector2f(width, height)
    ray, _ = camera.sample_ray(0.0, 0.5, place, mi.Point2f(0.5, 0.5))
    context, going = mi.BSDFContext(), mi.Mask(True)
    context.type_mask = mi.BSDFFlags.Null | mi.BSDFFlags.DeltaTransmission
    hit = scene.ray_intersect(ray)
    for _ in range(MOST_SURFACES):
        going &= hit.is_valid()
        sample, weight = hit.bsdf().sample(context, hit, 0.5, mi.Point2f(0.5, 0.5), going)
        passes = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
        passes |= mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaTransmission)
        going &= passes & (dr.max(weight) > 0)
        if not dr.any(going):
            break
        ray = dr.select(going, hit.spawn_ray(hit.to_world(sample.wo)), ray)
        beyond = scene.ray_intersect(ray, going)
        hit = dr.select(going, beyond, hit)
    in_camera = camera.world_transform().inverse() @ hit.p
    seen = np.array(hit.is_valid())
    depth = np.where(seen, np.array(in_camera.z, dtype=float), math.nan)
    on_pad, on_coat = np.zeros(width * height, dtype=bool), np.zeros(width * height, dtype=bool)
    displacement, pressure = np.full((width * height, 3), math.nan), np.full(width * height, math.nan)
    triangle, points = np.array(hit.prim_index), np.array(hit.p, dtype=float).T
    for pad in deformed_pads(scene):
        is_hit = seen & np.array(hit.shape == mi.ShapePtr(pad))
        code = np.rint(np.array(pad.eval_attribute_1("face_region", hit, mi.Mask(is_hit))))
        on_pad |= is_hit
        own = is_hit & (code == REGIONS["top"]) & (np.array(mi.Frame3f.cos_theta(hit.wi)) < 0)
        on_coat |= own
        displacement[own], pressure[own] = _on_surface(pad, triangle[own], points[own])
    if not any(map(is_pad, scene.shapes())):
        raise InputError("the scene holds no deformable_pad: a camera needs one, with cell = 'none'.")
    if not on_pad.any():
        raise InputError("the camera sees nothing of the pad: turn it towards the pad, or take away what hides it.")
    if not on_coat.any():
        raise InputError(
            "the camera does not see the coat (the top of the pad, from inside): place the camera below the pad, and "
            "give the region window the BSDF null."
        )
    _, weight = hit.bsdf().sample(mi.BSDFContext(), hit, 0.5, mi.Point2f(0.5, 0.5), mi.Mask(on_coat))
    if not (np.array(dr.max(weight)) * on_coat > 0).any():
        raise InputError(
            "the coat reflects nothing to the inside: the BSDF of region coat must reflect there, as twosided does."
        )
    return View(
        camera=camera,
        depth=depth.reshape(height, width),
        coat=on_coat.reshape(height, width),
        displacement=displacement.reshape(height, width, 3),
        points=np.where(on_coat[:, None], points, math.nan).reshape(height, width, 3),
        contact_pressure=None if not np.nansum(pressure) else pressure.reshape(height, width),
    )


def _on_surface(pad: PadShape, triangle: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (N, 3) in mm and contact pressure (N,) in MPa of a pad at points (N, 3) on its triangles (N,).

    Values at vertices are interpolated on the triangles that light sees; the pressure is NaN without an indenter."""
    rest, deformed = pad.undeformed.vertices, _placed(pad.surface.vertices, pad.to_world)
    numbers = pad.surface.triangles[triangle]
    first, *edges = np.moveaxis(_placed(pad.surface.facing, pad.to_world)[numbers], 1, 0)
    along = np.stack([edge - first for edge in edges], axis=-1)
    # Barycentric coordinates by least squares, as a point in single precision lies beside its triangle.
    normal_matrix = np.einsum("nik,nil->nkl", along, along)
    right = np.einsum("nik,ni->nk", along, points - first)
    second_third = np.linalg.solve(normal_matrix, right[..., None])[..., 0]
    weights = np.concatenate([1 - second_third.sum(axis=1, keepdims=True), second_third], axis=1)
    displacement = np.einsum("nk,nki->ni", weights, (deformed - rest)[numbers])
    pressure = np.full(len(numbers), math.nan)
    if pad.contact_pressure is not None:
        pressure = np.einsum("nk,nk->n", weights, pad.contact_pressure[numbers])
    return displacement, pressure


def _placed(vertices: np.ndarray, to_world: np.ndarray) -> np.ndarray:
    """Transform vertices (V, 3) of a pad to the coordinates of the scene."""
    return np.einsum("vi,ji->vj", vertices, to_world[:3, :3]) + to_world[:3, 3]
