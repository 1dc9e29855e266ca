"""A whole tactile sensor as one Python object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from types import NoneType
from typing import Any

import numpy as np

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.base.arguments import check_fields, is_number, is_row, refusal
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.mechanics import (
    Grooves,
    LayerSteps,
    Load,
    Material,
    Mullins,
    NeoHookean,
    RandomRoughness,
    SeparateFinish,
    SpreadForce,
    Viscoelastic,
)
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.specification.deformable_pad import DeformablePad
from mitsuba_taxel.specification.photo_reflector import PhotoReflector
from mitsuba_taxel.specification.region import Region
from mitsuba_taxel.specification.wall import ABSORBING, ISOTROPIC, Wall


@dataclass(frozen=True)
class PadSensor(Displayed):
    """A tactile sensor: a pad on a board with one photo-reflector in each cell.

    Parameters
    ----------
    pad : Pad
        The pad.
    material : Material or Viscoelastic or Mullins
        Material law of the silicone, such as `NeoHookean`, or `Viscoelastic` or `Mullins` with such a law.
    force : sequence of float
        Total force (Fx, Fy, Fz) on the pad, in N; compression is Fz < 0. For `PlateWrench`, the three components of a
        moment in N mm follow.
    load : Load
        Kind of load: `SpreadForce`, `PatchForce`, `PlateForce`, `PlateWrench` or `IndenterForce`. With
        `PlateDisplacement` and `IndenterDisplacement`, ``force`` is the displacement in mm; with `Pressure`, it is
        ``(pressure,)`` in MPa.
    photo_reflector : PhotoReflector
        Photo-reflector in each cell; its rows, columns and pitch are replaced by those of the pad.
    roof, side : Wall
        Scattering of the roofs and the side walls of the cells.
    time : float
        Time at which the load is reached, in s, for a `Viscoelastic` material.
    history : sequence of (float, sequence of float)
        Earlier times in s and values of the load, linear in between, for a viscoelastic material, one with Mullins'
        effect, or an indenter with friction.
    finish : LayerSteps or Grooves or RandomRoughness or SeparateFinish, optional
        Texture of roofs and side walls; smooth by default.

    Raises
    ------
    InputError
        if a part has the wrong type.
    """

    pad: Pad = field(default_factory=Pad)
    material: Material | Viscoelastic | Mullins = field(default_factory=NeoHookean)
    force: Sequence[float] = (0.0, 0.0, 0.0)
    load: Load = field(default_factory=SpreadForce)
    photo_reflector: PhotoReflector = field(default_factory=PhotoReflector)
    roof: Wall = ISOTROPIC
    side: Wall = ABSORBING
    finish: LayerSteps | Grooves | RandomRoughness | SeparateFinish | None = None
    time: float = 0.0
    history: Sequence[tuple[float, Sequence[float]]] = ()

    def __post_init__(self) -> None:
        check_fields(
            self,
            pad=(Pad, "a Pad"),
            material=(
                (Material, Viscoelastic, Mullins),
                "a Material, such as NeoHookean, a Viscoelastic or a Mullins",
            ),
            load=(Load, "a load, such as SpreadForce,"),
            photo_reflector=(PhotoReflector, "a PhotoReflector"),
            roof=(Wall, "a Wall"),
            side=(Wall, "a Wall"),
            finish=(
                (LayerSteps, Grooves, RandomRoughness, SeparateFinish, NoneType),
                "LayerSteps, Grooves, RandomRoughness, SeparateFinish or None",
            ),
        )
        if not is_row(self.force, is_number):
            raise refusal("force", self.force, "a list of finite numbers is needed")
        self._parts()

    @in_turn
    def scene(self) -> Scene:
        """Make the scene of the sensor, for :func:`measure`, for writing or for loading.

        Returns
        -------
        Scene
            Scene with a dictionary of Mitsuba objects as its source.

        Raises
        ------
        InputError
            if a part is refused.
        """
        import mitsuba as mi

        activate_variant()
        pad = self.pad
        deformed, reflector = self._parts()
        extent = max(pad.extent[:2])
        description = {
            "type": "scene",
            "integrator": {"type": "taxel_tracer"},
            "pad": deformed.to_dict(),
            "photo_reflector": reflector.to_dict(),
            "board": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().scale(extent),
                "bsdf": ABSORBING.to_dict(),
            },
        }
        return Scene(description)

    def _parts(self) -> tuple[DeformablePad, PhotoReflector]:
        """Specifications of the plugins of the scene; raises `InputError` if one is invalid."""
        pad, walls = self.pad, Region(roof=self.roof, side=self.side)
        past = {"time": self.time, "history": _rows(self.history)}
        deformed = DeformablePad.of(pad, self.material, self.load, self.force, self.finish, bsdf=walls, **past)
        return deformed, replace(self.photo_reflector, rows=pad.rows, columns=pad.columns, pitch=pad.pitch)


def _rows(history: object) -> str:
    """Format the times and values of a load history as in a scene; raises `InputError` if they are invalid."""

    def is_row_of_load(row: Any) -> bool:
        return is_row(row, lambda entry: is_number(entry) or is_row(entry, is_number)) and len(row) == 2

    if not is_row(history, is_row_of_load):
        raise refusal("history", history, "pairs of a time and a value of the load are needed")
    rows: Any = history
    return "; ".join(" ".join(repr(float(number)) for number in (time, *np.ravel(value))) for time, value in rows)
