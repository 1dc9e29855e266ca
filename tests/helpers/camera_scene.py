"""A block of silicone with a camera below, as a dictionary of Mitsuba."""

from __future__ import annotations

import math

from mitsuba_taxel.sensing import Scene

import mitsuba as mi  # isort: skip

WIDTH, DEPTH, HEIGHT, REFLECTANCE, DISTANCE = 20.0, 15.0, 4.0, 0.5, 20.0
PIXELS = 40, 30
FIELD = 26.0
"""Width in mm of the field of view at the coat."""
COAT = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": REFLECTANCE}}
CLEAR = {"type": "null"}
SIDE = 0.2
"""Side of the LED in mm."""


def led(x, y, z, tilt=0.0):
    """A small Lambertian LED that faces up, tilted from x by an angle in degrees."""
    turned = mi.ScalarTransform4f().translate([x, y, z]).rotate([0, 1, 0], tilt).scale([SIDE / 2, SIDE / 2, 1])
    return {"type": "rectangle", "to_world": turned, "light": {"type": "area", "radiance": 3.0}}


def scene(*lights, origin=(0, 0, HEIGHT - DISTANCE), target=(0, 0, 0), pixels=PIXELS, load=None, **others):
    """A block below lights and above a camera; ``load`` has properties of the pad, others are parts of the scene."""
    bottom, top = others.pop("bottom", CLEAR), others.pop("top", COAT)
    pad = {"type": "deformable_pad", "cell": "none", "width": WIDTH, "depth": DEPTH, "height": HEIGHT} | (load or {})
    walls = {"top": top, "bottom": bottom, "outer": others.pop("outer", CLEAR)}
    pad["bsdf"] = {"type": "region"} | others.pop("walls", walls)
    film = {"type": "hdrfilm", "width": pixels[0], "height": pixels[1], "rfilter": {"type": "box"}}
    film["pixel_format"] = "luminance"
    camera = {"type": "perspective", "fov": 2 * math.degrees(math.atan(0.5 * FIELD / DISTANCE)), "film": film}
    camera["to_world"] = mi.ScalarTransform4f().look_at(list(origin), list(target), [0, 1, 0])
    parts = {"type": "scene", "integrator": {"type": "path"}, "pad": pad, "camera": camera}
    return Scene(parts | {f"light{k}": light for k, light in enumerate(lights)} | others)
