"""A whole sensor as one Python object, and the scene that it makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import NoneType
from typing import Any, get_args

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.base.arguments import check_fields, is_number, is_row, refusal
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import (
    Grooves,
    LayerSteps,
    Load,
    Material,
    MooneyRivlin,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    RandomRoughness,
    SpreadForce,
    Yeoh,
)
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.parts import ABSORBING, ISOTROPIC, PhotoReflector, Wall
from mitsuba_taxel.sensing.scene import Scene


@dataclass(frozen=True)
class PadSensor(Displayed):
    """A pad on a board with one photo-reflector in each cell.

    Parameters
    ----------
    pad, material : the silicone; a material's law is `NeoHookean`, `MooneyRivlin` or `Yeoh`
    force : total force (Fx, Fy, Fz), in N; compression is Fz < 0
    load : how it acts: `SpreadForce`, `PatchForce` or `PlateForce`; for `PlateDisplacement` ``force`` is the
        displacement in mm, for `Pressure` it is ``(pressure,)`` in MPa
    photo_reflector : its rows, columns and pitch are those of the pad, whatever it says
    roof, side : what covers the cells
    finish : what the mould left on roof and side: `LayerSteps`, `Grooves` or `RandomRoughness`; None is smooth

    Raises
    ------
    InputError
        if a part is of another kind.
    """

    pad: Pad = field(default_factory=Pad)
    material: Material = field(default_factory=NeoHookean)
    force: Sequence[float] = (0.0, 0.0, 0.0)
    load: Load = field(default_factory=SpreadForce)
    photo_reflector: PhotoReflector = field(default_factory=PhotoReflector)
    roof: Wall = ISOTROPIC
    side: Wall = ABSORBING
    finish: LayerSteps | Grooves | RandomRoughness | None = None

    def __post_init__(self) -> None:
        check_fields(
            self,
            pad=(Pad, "a Pad"),
            material=(Material, "a Material, such as NeoHookean,"),
            load=(get_args(Load), "a load, such as SpreadForce,"),
            photo_reflector=(PhotoReflector, "a PhotoReflector"),
            roof=(Wall, "a Wall"),
            side=(Wall, "a Wall"),
            finish=((LayerSteps, Grooves, RandomRoughness, NoneType), "LayerSteps, Grooves, RandomRoughness or None"),
        )
        if not is_row(self.force, is_number):
            raise refusal("force", self.force, "a row of finite numbers is needed")

    @in_turn
    def scene(self) -> Scene:
        """The scene, ready to measure, write or load."""
        import mitsuba as mi

        activate_variant()
        pad = self.pad
        reflector = self.photo_reflector.to_dict()
        reflector.update(rows=pad.rows, columns=pad.columns, pitch=pad.pitch)
        extent = max(pad.extent[:2])
        description = {
            "type": "scene",
            "integrator": {"type": "taxel_tracer"},
            "pad": {
                "type": "deformable_pad",
                "cell": pad.cell,
                "rows": pad.rows,
                "columns": pad.columns,
                "pitch": pad.pitch,
                "wall": pad.wall,
                "height": pad.height,
                "cell_size": pad.cell_size,
                "cell_height": pad.top_of_cell,
                **_material_parameters(self.material),
                **_load_parameters(self.load, self.force),
                **_finish_parameters(self.finish),
                "walls": {"type": "region", "roof": self.roof.to_dict(), "side": self.side.to_dict()},
            },
            "photo_reflector": reflector,
            "board": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().scale(extent),
                "bsdf": ABSORBING.to_dict(),
            },
        }
        return Scene(description)


_LAWS = {NeoHookean: "neo_hookean", MooneyRivlin: "mooney_rivlin", Yeoh: "yeoh"}


def _material_parameters(material: Material) -> dict[str, Any]:
    """The parameters of the plugin `deformable_pad` that stand for a material."""
    if type(material) not in _LAWS:
        known = ", ".join(law.__name__ for law in _LAWS)
        raise InputError(f"material = {material!r} is not allowed in a scene: one of {known} is needed.")
    constants = {name: float(getattr(material, name)) for name in material.parameters}
    return {"material": _LAWS[type(material)], **constants}


def _load_parameters(load: Load, value: Sequence[float]) -> dict[str, Any]:
    """The parameters of the plugin `deformable_pad` that stand for a load and its value."""
    import mitsuba as mi

    if len(value) != load.components:
        raise InputError(f"force = {tuple(value)} is not allowed: {load.components} numbers are needed for {load}.")
    if isinstance(load, Pressure):
        return {"load": "pressure", "pressure": float(value[0])}
    vector = mi.ScalarVector3f(*map(float, value))
    if isinstance(load, PlateDisplacement):
        return {"load": "plate_displacement", "displacement": vector}
    if isinstance(load, PatchForce):
        (x, y), (width, depth) = load.centre, load.size
        patch = {"patch_x": x, "patch_y": y, "patch_width": width, "patch_depth": depth}
        return {"load": "patch_force", "force": vector, **patch}
    return {"load": "plate_force" if isinstance(load, PlateForce) else "spread_force", "force": vector}


def _finish_parameters(finish: LayerSteps | Grooves | RandomRoughness | None) -> dict[str, Any]:
    """The parameters of the plugin `deformable_pad` that stand for a finish."""
    import mitsuba as mi

    if finish is None:
        return {}
    refinement = {"finish_refinement": float(finish.refinement)}
    if isinstance(finish, LayerSteps):
        direction = mi.ScalarVector3f(*finish.direction)
        own = {"finish": "layer_steps", "layer_height": float(finish.layer_height), "print_direction": direction}
    elif isinstance(finish, Grooves):
        direction = mi.ScalarVector3f(*finish.direction)
        own = {"finish": "grooves", "groove_pitch": float(finish.pitch), "groove_depth": float(finish.depth)}
        own["groove_direction"] = direction
    else:
        own = {"finish": "random", "rms_height": float(finish.rms_height)}
        own.update(correlation_length=float(finish.correlation_length), roughness_seed=finish.seed)
    return own | refinement
