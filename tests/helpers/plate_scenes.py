"""Scenes of one LED and phototransistor: under a plate, in a closed box, under a soft pad of one cell."""

from __future__ import annotations

import numpy as np
from plate_reference import DETECTOR

from mitsuba_taxel import Pad, PadSensor, Scene

BODY_TOP = 0.5  # mm
ABSORBING = {"type": "wall", "scattering": "absorbing"}
WHITE = {"type": "wall"}
PLATE_FILE = """<scene version="3.9.0">
    <default name="fz" value="0.7"/> <default name="reflectance" value="1"/>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
    <shape type="rectangle">
        <transform name="to_world">
            <rotate x="1" angle="180"/> <scale x="2" y="2"/> <translate z="0.5"/> <translate z="$fz"/>
        </transform>
        <bsdf type="wall"> <float name="reflectance" value="$reflectance"/> </bsdf>
    </shape>
    <integrator type="taxel_tracer"/>
</scene>"""
"""No pad: the plate's height stands for a force, which costs nothing."""
SOFT_PAD = Pad("cylindrical", rows=1, columns=1, height=3.0, cell_height=0.85)


def plate(
    *,
    z: float = 0.7,
    law: str = "uniform_solid_angle",
    scattering: str = "lambertian",
    spacing: float = 0.7,
    offset: float = 0.0,
    width: float = 4.0,
    cone_angle: float | None = None,
    power: float = 1.0,
    motion=None,
    plate=None,
    integrator=None,
    **array,
) -> Scene:
    """What `plate.xml` holds, with a square plate at ``z`` above the LED's plane, all of it moved by ``motion``."""
    import mitsuba as mi

    motion = mi.ScalarTransform4f() if motion is None else motion
    flipped = mi.ScalarTransform4f().translate([offset, 0, BODY_TOP + z]).rotate([1, 0, 0], 180).scale(0.5 * width)
    led = {"type": "annular_led", "law": law, "hole": 0.0, "power": power}
    if cone_angle is not None:
        led["cone_angle"] = cone_angle
    rectangle = {"type": "rectangle", "to_world": motion @ flipped, "bsdf": {"type": "wall", "scattering": scattering}}
    return Scene(
        {
            "type": "scene",
            "integrator": integrator or {"type": "taxel_tracer"},
            "photo_reflector": {
                "type": "photo_reflector",
                "spacing": spacing,
                "to_world": motion,
                "led": led,
                "phototransistor": {"type": "phototransistor"},
                **array,
            },
            "plate": plate or rectangle,
        }
    )


def rectangles(
    *, x=0.7, turn=0.0, facing=1, led_half=0.125, board=None, block=False, plate=0.7, strategy="all"
) -> Scene:
    """LED and phototransistor on a rectangle each, in one plane under a Lambertian plate, and a board or a block."""
    import mitsuba as mi

    transform = mi.ScalarTransform4f()
    half = [0.5 * DETECTOR[0], 0.5 * DETECTOR[1], 1]
    detector = transform.translate([x, 0, 0]).rotate([0, 0, 1], turn).rotate([1, 0, 0], 90 - 90 * facing).scale(half)
    scene = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer", "strategy": strategy},
        "led": {
            "type": "rectangle",
            "to_world": transform.scale(led_half),
            "bsdf": ABSORBING,
            "emitter": {"type": "annular_led", "hole": 0.0},
        },
        "detector": {
            "type": "rectangle",
            "to_world": detector,
            "bsdf": ABSORBING,
            "sensor": {"type": "phototransistor"},
        },
        "plate": {
            "type": "rectangle",
            "to_world": transform.translate([0, 0, plate]).rotate([1, 0, 0], 180).scale(2),
            "bsdf": WHITE,
        },
    }
    if board is not None:
        scene["board"] = {"type": "rectangle", "to_world": transform.translate([0, 0, board]), "bsdf": ABSORBING}
    if block:
        middle = transform.translate([x, 0, 0.1]).scale([0.5, 0.4, 0.2])
        scene["block"] = {"type": "cube", "to_world": middle, "bsdf": ABSORBING}
    return Scene(scene)


def closed_cell(*, body, integrator: str = "taxel_tracer", strategy: str = "all") -> Scene:
    """A photo-reflector in a closed box of reflectance 1, 2.4 x 2 x 1.3 mm, whose floor cuts through the package."""
    import mitsuba as mi

    box = mi.ScalarTransform4f().translate([0, 0, 0.8]).scale([1.2, 1.0, 0.65])
    scene = plate(law="lambertian").source
    method = {"type": integrator, "strategy": strategy} if integrator == "taxel_tracer" else {"type": integrator}
    package = {**scene["photo_reflector"], "bsdf": body}
    cell = {"type": "cube", "to_world": box, "bsdf": WHITE}
    return Scene({"type": "scene", "integrator": method, "photo_reflector": package, "plate": cell})


def soft_sensor(force: float, roof=None, side=None) -> PadSensor:
    """A pad of one low cell, of a material ten times softer than the usual one."""
    from mitsuba_taxel.mechanics import NeoHookean

    walls = {name: wall for name, wall in (("roof", roof), ("side", side)) if wall is not None}
    return PadSensor(pad=SOFT_PAD, material=NeoHookean(youngs_modulus=0.416), force=(0, 0, force), **walls)


def moved(scene: dict, motion) -> Scene:
    """A scene whose shapes are moved and scaled."""
    import mitsuba as mi

    shapes = {name: part for name, part in scene.items() if isinstance(part, dict) and name != "integrator"}
    return Scene(
        {
            **scene,
            **{
                name: {**part, "to_world": motion @ part.get("to_world", mi.ScalarTransform4f())}
                for name, part in shapes.items()
            },
        }
    )


def column(readings) -> tuple[np.ndarray, np.ndarray]:
    """Powers and standard errors of scenes with one taxel."""
    return np.array([r.power[0] for r in readings]), np.array([r.standard_error[0] for r in readings])
