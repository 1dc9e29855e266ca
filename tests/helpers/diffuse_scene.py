"""One cell with diffuse walls on one photo-reflector, its derivatives, and the same with a parameter changed."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel import Scene
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse.deterministic_light import FINE

FORCE = [0.05, 0.02, -0.8]
LED = {"type": "annular_led", "power": 0.5}
LOW = {"cell_height": 1.5, "cell_size": 2.5}
"""A dome that begins below the top of the package, which takes up a hundredth of the light between its walls."""
STEPS = {"fz": 2e-3, "fx": 2e-3, "youngs_modulus": 0.01, "poisson_ratio": 1e-4, "spacing": 2e-3, "reflectance": 1e-3}


def pad_scene(wall=None, led=None, sensor=None, board=None, **pad):
    """One cell on one photo-reflector."""
    given = {"cell": "hemispheric", "rows": 1, "columns": 1, "mesh_size": 1.7, "force": FORCE, **pad}
    given = {name: value for name, value in given.items() if value is not None}
    if "load" in pad:
        del given["force"]
    roof = {"type": "wall", "scattering": "isotropic", "reflectance": 0.9, **(wall or {})}
    parts = {"led": {**LED, **(led or {})}, "detector": {"type": "phototransistor", **(sensor or {})}}
    scene = {
        "type": "scene",
        "pad": {"type": "deformable_pad", **given, "bsdf": {"type": "region", "roof": roof}},
        "package": {"type": "photo_reflector", "spacing": 0.9, **parts},
    }
    return Scene(scene | ({} if board is None else {"board": board}))


def derivatives(scene, *names, with_errors=False, degree=FINE):
    return derivatives_by([rates(scene, name) for name in names], scene.load(), with_errors, degree=degree)


def at(name, change, **pad):
    """The scene with a parameter a little larger."""
    force = np.array(FORCE)
    given = {
        "fz": {"force": (force + [0, 0, change]).tolist()},
        "fx": {"force": (force + [change, 0, 0]).tolist()},
        "youngs_modulus": {"youngs_modulus": 4.16 + change},
        "poisson_ratio": {"poisson_ratio": 0.49 + change},
        "reflectance": {"wall": {"reflectance": 0.9 + change}},
    }
    scene = pad_scene(**given.get(name, {}), **pad)
    if name == "spacing":
        scene.source["package"]["spacing"] += change
    return scene


def by(derivatives, name):
    column = derivatives.parameters.index(name)
    return derivatives.values[0, column], derivatives.standard_errors[0, column]
