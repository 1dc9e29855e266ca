"""The parts of a sensor as Python objects, and the scene that they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from mitsuba_taxel.mechanics import Grooves, LayerSteps, NeoHookean, RandomRoughness
from mitsuba_taxel.optics.scene import Scene
from mitsuba_taxel.pads import Pad


@dataclass(frozen=True)
class Wall:
    """A wall: ``scattering`` is mirror, lambertian, isotropic or absorbing; ``reflectance`` from 0 to 1."""

    scattering: str = "lambertian"
    reflectance: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """The `wall` plugin as a Mitsuba dictionary."""
        if self.scattering == "absorbing":
            return {"type": "wall", "scattering": "absorbing"}
        return {"type": "wall", "scattering": self.scattering, "reflectance": float(self.reflectance)}


@dataclass(frozen=True)
class PhotoReflector:
    """An array of photo-reflectors, as the plugins take it; the defaults are those of the NJL5908AR.

    Parameters
    ----------
    rows, columns, pitch : the array and the distance between neighbours in mm
    spacing : distance in mm between the centres of LED and phototransistor, along x
    power, law : what an LED emits, in W, and how; see the plugin `annular_led`
    size, hole : sides in mm of the LED's emitting square and of its dark centre
    width, depth : extent in mm of a phototransistor along x and y

    What is not allowed is refused when the scene is loaded.
    """

    rows: int = 1
    columns: int = 1
    pitch: float = 3.55
    spacing: float = 0.9
    power: float = 1.0
    size: float = 0.25
    hole: float = 0.1
    law: str = "uniform_solid_angle"
    width: float = 0.52
    depth: float = 0.3

    def to_dict(self) -> dict[str, Any]:
        """The `photo_reflector` plugin with its LED and phototransistor as a Mitsuba dictionary."""
        led = {
            "type": "annular_led",
            "power": self.power,
            "size": self.size,
            "hole": self.hole,
            "law": self.law,
        }
        return {
            "type": "photo_reflector",
            "rows": self.rows,
            "columns": self.columns,
            "pitch": self.pitch,
            "spacing": self.spacing,
            "led": led,
            "phototransistor": {"type": "phototransistor", "width": self.width, "depth": self.depth},
        }


ABSORBING = Wall("absorbing")
ISOTROPIC = Wall("isotropic")


@dataclass(frozen=True)
class PadSensor:
    """A pad on a board with one photo-reflector in each cell.

    Parameters
    ----------
    pad, material : the silicone
    force : total force (Fx, Fy, Fz) on the top, in N; compression is Fz < 0
    photo_reflector : its rows, columns and pitch are those of the pad, whatever it says
    roof, side : what covers the cells
    finish : what the mould left on roof and side: `LayerSteps`, `Grooves` or `RandomRoughness`; None is smooth
    """

    pad: Pad = field(default_factory=Pad)
    material: NeoHookean = field(default_factory=NeoHookean)
    force: Sequence[float] = (0.0, 0.0, 0.0)
    photo_reflector: PhotoReflector = field(default_factory=PhotoReflector)
    roof: Wall = ISOTROPIC
    side: Wall = ABSORBING
    finish: LayerSteps | Grooves | RandomRoughness | None = None

    def scene(self) -> Scene:
        """The scene, ready to measure, write or load."""
        import mitsuba as mi

        from mitsuba_taxel.backend import activate_variant

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
                "youngs_modulus": self.material.youngs_modulus,
                "poisson_ratio": self.material.poisson_ratio,
                "force": mi.ScalarVector3f(*map(float, self.force)),
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
