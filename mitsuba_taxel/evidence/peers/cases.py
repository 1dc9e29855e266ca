"""Cases for comparisons with other programs: shipped scenes with values of their parameters."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel import Scene  # before anything imports mitsuba: it chooses the LLVM
from mitsuba_taxel.sensing import find_scene

LED_SIDE = 0.25
DETECTOR = (0.52, 0.3)

Estimator = Callable[[int, int], np.ndarray]
"""Function of (samples per taxel, seed) that returns the power (T,) on each taxel's phototransistor in W; all LEDs emit
1 W."""


class UnsupportedCase(Exception):
    """Error: a program does not support a case; the message has the reason."""


@dataclass(frozen=True)
class PeerCase:
    """A shipped scene with values of its parameters; lengths in mm, forces in N.

    ``exponent`` is the power of the cosine in the phototransistor's response; 1 is ideal.
    """

    name: str
    scene: str
    parameters: dict[str, Any]
    exponent: float = 1

    def require_ideal(self) -> None:
        """Raise `UnsupportedCase` if the phototransistor is not ideal, for programs without angular responses."""
        if self.exponent != 1:
            raise UnsupportedCase("its angular responses are not set up for this comparison")

    @property
    def single_bounce(self) -> bool:
        """Whether the scene is the flat plate, at which light is reflected once only."""
        return self.scene == "plate.xml"

    def plate(self) -> tuple[float, float]:
        """Height of the plate and die spacing in mm; raises `UnsupportedCase` for other scenes, which are not
        implemented for this program."""
        self.require_ideal()
        if not self.single_bounce:
            raise UnsupportedCase("meshes with a wall for each region are not set up for this comparison")
        return float(self.parameters["z"]), float(self.parameters["spacing"])

    @property
    def isotropic(self) -> bool:
        """Whether the roof scatters isotropically, instead of by Lambert's law."""
        return self.parameters["scattering"] == "isotropic"

    def load(self, integrator: str, sampler: str | None = None) -> Any:
        """Load the scene with an integrator and, if given, a sampler, by the names of their plugins."""
        text = find_scene(self.scene).read_text(encoding="utf-8").replace('type="taxel_tracer"', f'type="{integrator}"')
        response = f'<string name="response" value="cosine_power"/> <float name="exponent" value="{self.exponent}"/>'
        nested = response + (f'<sampler type="{sampler}"/>' if sampler else "")
        text = text.replace('<sensor type="phototransistor"/>', f'<sensor type="phototransistor">{nested}</sensor>')
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / self.scene
            file.write_text(text, encoding="utf-8")
            return Scene.from_file(file, **self.parameters).load()


def _plate(z: float) -> PeerCase:
    values = {"z": z, "spacing": 0.7, "hole": 0, "law": "lambertian", "scattering": "lambertian"}
    return PeerCase(f"plate-{z:g}", "plate.xml", values)


def _narrow() -> PeerCase:
    return PeerCase("narrow", "plate.xml", _plate(1.05).parameters, exponent=50)


def _pad(scattering: str, fz: float) -> PeerCase:
    values = {"cell": "hemispheric", "fz": fz, "hole": 0, "law": "lambertian", "scattering": scattering}
    return PeerCase(f"pad-{scattering}{fz:g}" if fz else f"pad-{scattering}", "pad.xml", values)


CASES = {
    case.name: case
    for case in (
        *(_plate(z) for z in (1.05, 0.3, 0.1)),
        _narrow(),
        *(_pad(scattering, fz) for scattering in ("lambertian", "isotropic") for fz in (0, -10)),
    )
}
