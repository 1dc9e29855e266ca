"""Refusal of scenes whose readings would be wrong, for `measure` and `taxel check`."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.carriers import matrix_of
from mitsuba_taxel.kernels.paths.taxel_integrators import traces_taxels
from mitsuba_taxel.kernels.protocols import NO_ROOM, has_faces, is_owen_sobol, is_package, is_pad
from mitsuba_taxel.kernels.walls import refuse_unknown_wavelength, wall_at, walls_of
from mitsuba_taxel.sensing.scene.clearance import heed_packages
from mitsuba_taxel.sensing.scene.taxels import refuse_foreign_sensors, taxels_of
from mitsuba_taxel.sensing.validity.foreign_walls import refuse_foreign_walls
from mitsuba_taxel.sensing.validity.shared_places import FLAT, refuse_shared_places, refuse_shared_planes

OF_MITSUBA = {
    "PathIntegrator": "path",
    "ParticleTracerIntegrator": "ptracer",
    "VolumetricPathIntegrator": "volpath",
    "VolpathMisIntegratorImpl": "volpathmis",
}
"""Class and plugin of Mitsuba's integrators that estimate the entire power; other integrators miss a part of it."""
_THROUGH_MEDIA = ("volpath", "volpathmis")
LARGEST_REACH = 1000.0
"""Largest distance of LEDs and phototransistors from the origin, relative to the side of their faces. At this limit,
250 mm with the NJL5908AR, rounding in single precision changes readings of a domed cell by 0.04 %."""
LARGEST_STEP = 0.01
"""Largest ray offset of Mitsuba's own integrators, relative to the side of a face. It grows with the distance from the
origin; at this limit, 27 mm with the NJL5908AR, readings of a domed cell change by 0.14 %."""


def refuse_unmodelled(scene: mi.Scene, integrator: mi.Integrator) -> None:
    """Raise an error for a scene whose readings would miss light, or would be wrong for another reason.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene, or any object with ``shapes()``, ``emitters()`` and ``sensors()``.
    integrator : mi.Integrator
        The integrator that traces its light.

    Raises
    ------
    InputError
        if the integrator does not support the scene, if LEDs and phototransistors cannot be paired, or if another
        surface coincides with an LED or a phototransistor.
    ComputationError
        if a deformed pad touches a package without `self_contact`.
    """
    ours = traces_taxels(integrator)
    plugin = OF_MITSUBA.get(integrator.class_name(), "")
    if not ours and not plugin:
        raise InputError(
            f"integrator {kind_of(integrator)} does not estimate the entire power: taxel_tracer, taxel_path, "
            f"analog_tracer or one of Mitsuba's {', '.join(OF_MITSUBA.values())} is needed.",
            integrator,
        )
    if getattr(integrator, "hide_emitters", False):
        raise InputError("hide_emitters = true is not allowed: direct light counts; set it to false.", integrator)
    _refuse_blocks(scene)
    _refuse_instances(scene)
    _refuse_walls_without_area(scene)
    _refuse_media(scene, plugin)
    if ours:
        _refuse_other_windows(scene)
        _refuse_samplers(scene)
        getattr(integrator, "refuse_unbounded", lambda scene: None)(scene)
    else:
        refuse_foreign_sensors(scene)
        _refuse_unseen_emitters(scene, plugin)
    _refuse_far_faces(scene, ours)
    refuse_shared_places(scene)
    heed_packages(scene)
    refuse_shared_planes(scene)
    refuse_foreign_walls(scene, plugin)
    if plugin == "ptracer" and any(wall is not None and _is_mirror(wall) for wall in walls_of(scene)):
        raise InputError("integrator ptracer sees no light via mirrors: use taxel_tracer or path.", integrator)
    _refuse_unseen_indenters(scene)
    _refuse_moved_packages(scene)
    refuse_unknown_wavelength(scene, one_by_one=ours)


def _refuse_blocks(scene: mi.Scene) -> None:
    """Raise `InputError` for a pad without cells, because photo-reflectors need cells."""
    for pad in filter(is_pad, scene.shapes()):
        from mitsuba_taxel.pads import Block  # a scene without a pad omits it

        is_meshed = pad.state is not None  # `taxel check` looks at pads before they are meshed
        if isinstance(pad.pad, Block) or (is_meshed and not pad.state.mesh.face_cell.any()):
            raise InputError(
                f"{NO_ROOM}: readings need a pad with cells; `taxel render` makes a camera's image.", pad
            )


def _refuse_instances(scene: mi.Scene) -> None:
    """Raise `InputError` for an instance, because its walls and media cannot be inspected."""
    for shape in scene.shapes():
        if kind_of(shape) == "instance":
            raise InputError("instance is not allowed, as its walls cannot be checked: put the shape itself there.")


def _refuse_walls_without_area(scene: mi.Scene) -> None:
    """Raise `InputError` for a rectangle or disk that is scaled by 0 in its plane, and so reflects nothing."""
    flat = (shape for shape in scene.shapes() if not is_pad(shape) and shape.class_name() in FLAT)
    for shape in flat:
        if not np.cross(*matrix_of(shape)[:3, :2].T).any():
            raise InputError(f"{kind_of(shape)} has no area: its to_world must not scale it by 0.", shape)


def _is_mirror(wall: mi.BSDF) -> bool:
    return bool(wall.flags() & mi.BSDFFlags.Delta)


def _refuse_media(scene: mi.Scene, plugin: str) -> None:
    """Raise `InputError` for a participating medium if the integrator ignores media."""
    if plugin in _THROUGH_MEDIA:
        return
    media = [shape.interior_medium() or shape.exterior_medium() for shape in scene.shapes()]
    if any(media) or any(end.get_medium() for end in (*scene.emitters(), *scene.sensors())):
        raise InputError(
            "the scene holds a participating medium, which only Mitsuba's integrators volpath and volpathmis see: "
            "use one of them, or take it out."
        )


def _refuse_other_windows(scene: mi.Scene) -> None:
    """Raise `InputError` if LEDs and phototransistors cannot be paired, or if light would travel directly from the
    window of one package to the window of another.
    """
    for pair in taxels_of(scene):
        if pair.is_below_windows and not pair.coplanar:
            raise InputError(
                "photo_reflector: an LED below a window forms a taxel with a phototransistor of another object, which "
                "is not modelled: list LEDs and phototransistors in the same order."
            )


def _refuse_unseen_emitters(scene: mi.Scene, plugin: str) -> None:
    """Raise `InputError` if Mitsuba's integrators would miss light that travels directly from an emitter to a
    phototransistor.

    The rays of these integrators start at a phototransistor, and never hit a point light or follow a single direction.
    With ``ptracer``, light from infinity was 3 % too strong.
    """
    for emitter in scene.emitters():
        flags, kind = emitter.flags(), kind_of(emitter)
        if flags & mi.EmitterFlags.Delta:
            raise InputError(
                f"emitter {kind} shines from a point or in one direction, so that light straight to a phototransistor "
                "would be left out: use an annular_led, or an area emitter.",
                emitter,
            )
        if plugin == "ptracer" and flags & mi.EmitterFlags.Infinite:
            raise InputError(f"integrator ptracer gives wrong readings of {kind} emitters: use path.", emitter)


def _refuse_samplers(scene: mi.Scene) -> None:
    """Raise `InputError` for a phototransistor with a sampler other than owen_sobol."""
    for sensor in scene.sensors():
        sampler = sensor.sampler()
        if not is_owen_sobol(sampler):
            raise InputError(f"phototransistor: its sampler must be owen_sobol, not {kind_of(sampler)}.", sampler)


def _refuse_unseen_indenters(scene: mi.Scene) -> None:
    """Raise `InputError` if light may leave a pad towards an indenter. An indenter is not a surface of the scene, and
    would not block the light.
    """
    for shape in scene.shapes():
        if not is_pad(shape) or shape.specification.indenter is None:
            continue
        for region in ("top", "outer"):
            wall = wall_at(shape.bsdf(), region)
            if wall is not None and wall.flags() & (mi.BSDFFlags.Transmission | mi.BSDFFlags.Null):
                raise InputError(
                    f"bsdf {region} of a pad under an indenter is not allowed: it lets light through, and the indenter "
                    "would not block it; an opaque wall is needed."
                )


def _refuse_moved_packages(scene: mi.Scene) -> None:
    """Raise `InputError` if the vertices of a package were changed, because its LED and phototransistor do not
    follow."""
    for shape in scene.shapes():
        if is_package(shape) and not shape.is_as_built():
            raise InputError(
                "photo_reflector: its vertex_positions or faces were changed, but LED and phototransistor do not "
                "follow: load the scene again with another to_world."
            )


def _refuse_far_faces(scene: mi.Scene, ours: bool) -> None:
    """Raise `InputError` for an LED or phototransistor so far from the origin that rounding or ray offsets would change
    readings."""
    for end in (*scene.emitters(), *scene.sensors()):
        if not has_faces(end):
            continue
        reach = float(np.abs(np.array(end.faces.centres)).max())
        side = float(np.sqrt(np.array(end.faces.size, dtype=float).prod()))
        furthest = LARGEST_REACH * side if ours else LARGEST_STEP * side / 9e-5 - 1
        if reach > furthest:
            limited_by = "single precision" if ours else "Mitsuba's own integrator"
            raise InputError(
                f"{kind_of(end)} lies {reach:.3g} mm from the origin, where {limited_by} does not resolve its face of "
                f"{side:.3g} mm well enough: at most {max(furthest, 0):.3g} mm are allowed, so move the whole scene to "
                f"the origin{'' if ours else ', scale it up, or use taxel_tracer'}.",
                end,
            )
