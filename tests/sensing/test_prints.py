"""Prints in images: slopes from three colours, as GelSight sensors are read, and the radius of a ball's print."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_scene import DISTANCE, HEIGHT, REFLECTANCE, SIDE, scene

from mitsuba_taxel.sensing.camera import camera_image
from mitsuba_taxel.sensing.camera_view import view_of
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

import mitsuba as mi  # isort: skip

LIGHTS = {"1, 0, 0": (9.0, 0.0), "0, 1, 0": (-5.0, 8.0), "0, 0, 1": (-5.0, -8.0)}
"""Places along x and y in mm of small lights that face up, by their colours."""
LIGHT_Z = -6.0
MODULUS, RATIO = 0.2, 0.49


def camera(field, pixels, pixel_format):
    """A camera below the block, with a field of view ``field`` mm wide at the unloaded coat."""
    film = {"type": "hdrfilm", "width": pixels[0], "height": pixels[1], "pixel_format": pixel_format}
    angle = 2 * math.degrees(math.atan(0.5 * field / DISTANCE))
    place = mi.ScalarTransform4f().look_at([0, 0, HEIGHT - DISTANCE], [0, 0, 0], [0, 1, 0])
    own = {"sampler": {"type": "ldsampler"}, "to_world": place}  # it divides samples evenly between lights
    return own | {"type": "perspective", "fov": angle, "film": film | {"rfilter": {"type": "box"}}}


@pytest.fixture
def colours():
    mi.set_variant("llvm_ad_rgb")


@pytest.mark.parametrize(("x", "depth", "radius"), [(0.0, 0.4, 4.0), (1.5, 0.7, 2.5)])
def test_three_colours_give_the_normals_of_the_coat(colours, x, depth, radius):
    ball = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": radius, "indenter_x": x}
    block = {"width": 12.0, "depth": 12.0, "youngs_modulus": MODULUS, "displacement": [0.0, 0.0, -depth]}
    lights = []
    for words, (along_x, along_y) in LIGHTS.items():
        turned = mi.ScalarTransform4f().translate([along_x, along_y, LIGHT_Z]).scale([SIDE / 2, SIDE / 2, 1])
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": [float(word) for word in words.split(",")]}}
        lights.append({"type": "rectangle", "to_world": turned, "light": emitter})
    # Direct light alone: the colours of light that the print reflects to itself do not tell the slope.
    parts = {"camera": camera(10.0, (100, 75), "rgb"), "integrator": {"type": "path", "max_depth": 2}}
    live = scene(*lights, load=ball | block, **parts).load()
    image, points = camera_image(live, samples=64), view_of(live).points

    # Each colour is linear in the normal: radiance = reflectance / pi * (irradiance of normal incidence) * cosine.
    rows = []
    for along_x, along_y in LIGHTS.values():
        to_coat = points - [along_x, along_y, LIGHT_Z]
        distance = np.linalg.norm(to_coat, axis=-1, keepdims=True)
        rows.append(SIDE**2 * REFLECTANCE / math.pi * to_coat[..., 2:] / distance**4 * to_coat)
    normal = np.linalg.solve(np.stack(rows, axis=-2), image.radiance[..., None])[..., 0]
    lit = image.coat & (image.radiance > 0).all(axis=-1)

    # The normal of the coat's shape, from the places of neighbouring pixels.
    shape = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    shape *= np.sign(shape[..., 2:])
    lit &= np.isfinite(shape).all(axis=-1)
    cosine = (normal * shape).sum(axis=-1) / np.linalg.norm(normal, axis=-1) / np.linalg.norm(shape, axis=-1)
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))[lit]
    steepest = np.degrees(np.arccos(shape[..., 2] / np.linalg.norm(shape, axis=-1)))[lit].max()
    assert lit.mean() > 0.97 and steepest > 12
    assert np.sqrt(np.square(angle).mean()) < 1.0 and np.quantile(angle, 0.95) < 2.0
    # The albedo is that of the coat: the length of the normal is 1.
    assert np.median(np.linalg.norm(normal, axis=-1)[lit]) == pytest.approx(1, abs=0.005)


@pytest.mark.parametrize(("radius", "depth"), [(2.0, 0.06), (3.0, 0.08)])
def test_the_print_of_a_ball_in_the_image_has_the_radius_of_hertz(llvm_mono, radius, depth):
    ball = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": radius}
    block = {"width": 12.0, "depth": 12.0, "height": 6.0, "youngs_modulus": MODULUS, "poisson_ratio": RATIO}
    load = ball | block | {"displacement": [0.0, 0.0, -depth], "mesh_size": 0.9}
    live = scene({"type": "point", "intensity": 1.0}, load=load, camera=camera(2.0, (120, 120), "luminance")).load()
    view = view_of(live)
    force = -pad_results([pad.state for pad in deformed_pads(live)], with_errors=False)["reaction_fz"].value
    # The mean square distance from the axis, weighted by the pressure of Hertz, is 2/5 of the squared radius.
    squared = (view.points[..., :2] ** 2).sum(axis=-1)
    pressure = np.maximum(view.contact_pressure, 0)
    print_radius = math.sqrt(2.5 * np.nansum(pressure * squared) / np.nansum(pressure))
    reduced = MODULUS / (1 - RATIO**2)
    assert print_radius == pytest.approx((0.75 * force * radius / reduced) ** (1 / 3), rel=0.02)
