"""What a scene says of a pad: its shape, its silicone, its load and the finish of its cells."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.parameters import choice, number, whole_number
from mitsuba_taxel.pads import Pad, PadFile
from mitsuba_taxel.pads.imported.rules import read_rules

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import Finish, Load, Material

LAWS = {
    "neo_hookean": ("youngs_modulus", "shore_a"),
    "mooney_rivlin": ("c10", "c01"),
    "yeoh": ("c10", "c20", "c30"),
}
"""Parameters of each material law besides Poisson's ratio."""

LOADS = {
    "spread_force": "force",
    "patch_force": "force",
    "plate_force": "force",
    "plate_displacement": "displacement",
    "pressure": "pressure",
}
"""The parameter that holds the value of each load."""

MOST_TRIANGLES = 20_000_000
LEAST_FACES = 15
"""Of the finite elements on the surface of a cell, however large they may be."""

_COUNTS = ("rows", "columns")
_LENGTHS = ("pitch", "wall", "height", "cell_size", "cell_height")
_PATCH = ("patch_x", "patch_y", "patch_width", "patch_depth")


def read_pad(props: mi.Properties) -> Pad | PadFile:
    """The pad of a scene; raises `InputError`."""
    if "filename" in props:
        _refuse(props, ("cell", *_COUNTS, *_LENGTHS), "the pad is that of filename")
        rules = read_rules(_file(props, "regions")) if "regions" in props else ()
        return PadFile(_file(props, "filename"), rules)
    _refuse(props, ("regions",), "it is only for a pad of filename")
    lengths = {name: number(props, name, above=0) for name in _LENGTHS if name in props}
    counts = {name: whole_number(props, name, 3, minimum=1, maximum=100) for name in _COUNTS}
    return Pad(cell=props.get("cell", Pad.cell), rows=counts["rows"], columns=counts["columns"], **lengths)


def read_material(props: mi.Properties) -> Material:
    """The silicone of a scene; raises `InputError`."""
    from mitsuba_taxel.mechanics import SILICONES, MooneyRivlin, NeoHookean, Yeoh, from_shore_a, silicone

    name = choice(props, "material", "neo_hookean", (*LAWS, *SILICONES))
    own = LAWS.get(name, ())
    others = {parameter for law in LAWS.values() for parameter in law} - set(own)
    _refuse(props, sorted(others), f"material = {name!r} takes {', '.join((*own, 'poisson_ratio'))}")
    ratio = {"poisson_ratio": number(props, "poisson_ratio", 0.49, minimum=0, maximum=0.5)}
    if name == "mooney_rivlin":
        return MooneyRivlin(number(props, "c10", minimum=0), number(props, "c01", minimum=0), **ratio)
    if name == "yeoh":
        return Yeoh(number(props, "c10", above=0), number(props, "c20", 0.0), number(props, "c30", 0.0), **ratio)
    if name in SILICONES:
        return silicone(name).changed(**(ratio if "poisson_ratio" in props else {}))
    if "shore_a" in props:
        _refuse(props, ("youngs_modulus",), "it and shore_a exclude each other, give one of them")
        return from_shore_a(number(props, "shore_a"), **ratio)
    return NeoHookean(number(props, "youngs_modulus", 4.16, above=0), **ratio)


def read_load(props: mi.Properties) -> tuple[Load, tuple[float, ...]]:
    """The load of a scene and its value; raises `InputError`."""
    from mitsuba_taxel.mechanics import PatchForce, PlateDisplacement, PlateForce, Pressure, SpreadForce

    name = choice(props, "load", "spread_force", tuple(LOADS))
    _refuse(props, sorted(set(LOADS.values()) - {LOADS[name]}), f"load = {name!r} takes {LOADS[name]}")
    if name == "patch_force":
        width, depth = number(props, "patch_width", above=0), number(props, "patch_depth", above=0)
        load: Load = PatchForce((number(props, "patch_x", 0.0), number(props, "patch_y", 0.0)), (width, depth))
    else:
        _refuse(props, _PATCH, "it is only for load = 'patch_force'")
        plain: tuple[Load, ...] = (SpreadForce(), PlateForce(), PlateDisplacement(), Pressure())
        load = dict(zip(("spread_force", "plate_force", "plate_displacement", "pressure"), plain, strict=True))[name]
    if name == "pressure":
        return load, (number(props, "pressure", 0.0),)
    return load, _three(props, LOADS[name])


def take_value(props: mi.Properties) -> tuple[float, ...]:
    """The value of the load of a scene, which is left without; raises `InputError`."""
    _, value = read_load(props)
    for name in set(LOADS.values()) & set(props.keys()):
        del props[name]
    return value


def read_mesh(props: mi.Properties) -> tuple[float | None, float | None]:
    """The mesh size and the mesh tolerance of a scene, at most one of which it gives; raises `InputError`."""
    if "mesh_tolerance" in props:
        _refuse(props, ("mesh_size",), "it and mesh_tolerance exclude each other, give one of them")
        return None, number(props, "mesh_tolerance", above=0, maximum=1)
    return (number(props, "mesh_size", above=0) if "mesh_size" in props else None), None


def read_cells(props: mi.Properties) -> tuple[int, ...] | None:
    """Numbers of the cells that are read, None for all; raises `InputError`."""
    words = str(props.get("read_cells", "all")).replace(",", " ").split()
    if words == ["all"]:
        return None
    if not words or not all(word.isdecimal() and int(word) > 0 for word in words):
        raise InputError(
            f"read_cells = {' '.join(words)!r} is not allowed: 'all' or numbers of cells such as '1, 5' are needed."
        )
    return tuple(sorted({int(word) for word in words}))


def check_triangles(subdivision: int, faces: int) -> None:
    """Refuse a subdivision of so many faces of cells that it takes too many triangles; raises `InputError`."""
    triangles = faces * subdivision**2
    if triangles > MOST_TRIANGLES:
        raise InputError(
            f"subdivision = {subdivision} is not allowed: the surface of the cells would have {triangles:.1e} "
            f"triangles, more than {MOST_TRIANGLES:.0e}; choose less, or name the cells that are read."
        )


def read_finish(props: mi.Properties) -> Finish | None:
    """The finish of a scene's cells, None if they are smooth; raises `InputError`."""
    from mitsuba_taxel.mechanics import Grooves, LayerSteps, RandomRoughness

    name = choice(props, "finish", "smooth", ("smooth", "layer_steps", "grooves", "random"))
    if name == "smooth":
        return None
    _refuse(props, ("filename",), f"finish = {name!r} is only for pads of this package's own shapes")
    default = RandomRoughness.refinement if name == "random" else LayerSteps.refinement
    refinement = number(props, "finish_refinement", default, above=0)
    if name == "layer_steps":
        direction = tuple(props.get("print_direction", mi.ScalarVector3f(0, 0, 1)))
        return LayerSteps(number(props, "layer_height", above=0), direction, refinement)
    if name == "grooves":
        direction = tuple(props.get("groove_direction", mi.ScalarVector3f(1, 0, 0)))
        pitch, depth = number(props, "groove_pitch", above=0), number(props, "groove_depth", above=0)
        return Grooves(pitch, depth, direction, refinement)
    rms, length = number(props, "rms_height", above=0), number(props, "correlation_length", above=0)
    seed = whole_number(props, "roughness_seed", 0, minimum=0, maximum=2**31 - 1)
    return RandomRoughness(rms, length, seed, refinement)


def _refuse(props: mi.Properties, names: tuple[str, ...] | list[str], why: str) -> None:
    for name in names:
        if name in props:
            raise InputError(f"{name} is not allowed here: {why}.")


def _three(props: mi.Properties, name: str) -> tuple[float, ...]:
    value = tuple(float(component) for component in props.get(name, mi.ScalarVector3f(0, 0, 0)))
    if not np.all(np.isfinite(value)):
        raise InputError(f"{name} = {value} is not allowed: three finite numbers are needed.")
    return value


def _file(props: mi.Properties, name: str) -> Path:
    """A file named in a scene, looked for beside the scene."""
    return Path(str(mi.file_resolver().resolve(str(props.get(name)))))
