"""The paper's sensor as a scene file; every choice that the paper leaves open is a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.mechanics import NeoHookean

PITCH = 3.55
YOUNGS_MODULUS, POISSON_RATIO = NeoHookean().youngs_modulus, NeoHookean().poisson_ratio
CORNER, CENTRE = 3, 5
"""The taxels of the variations: the corner (+x, +y) and the centre."""

_REFLECTOR = """
    <shape type="photo_reflector">
        <transform name="to_world"><translate value="{x}, {y}, 0"/></transform>
        <float name="spacing" value="$spacing"/>
        <emitter type="annular_led">
            <float name="hole" value="$hole"/>
            <string name="law" value="$law"/>
        </emitter>
        <sensor type="phototransistor">
            <float name="width" value="$detector_width"/>
            <float name="depth" value="$detector_depth"/>
        </sensor>
        <bsdf type="wall">
            <string name="scattering" value="lambertian"/>
            <float name="reflectance" value="$body_reflectance"/>
        </bsdf>
    </shape>
"""


def scene_text(name: str) -> str:
    """Text of an XML scene file in the folder ``scene_files``; names in braces are placeholders for `str.format`."""
    return (Path(__file__).with_name("scene_files") / f"{name}.xml").read_text(encoding="utf-8")


def write_scene(file: Path, taxels: Sequence[int]) -> None:
    """Write the scene with photo-reflectors in the cells ``taxels`` only, in the order of their readings."""
    reflectors = "".join(_REFLECTOR.format(x=x, y=y) for x, y in map(centre_of, taxels))
    cells = ", ".join(map(str, taxels))
    c10 = moduli(POISSON_RATIO)["c10"]
    values = {"c10": c10, "poisson_ratio": POISSON_RATIO}
    write_text(file, scene_text("paper").format(cells=cells, reflectors=reflectors, **values))


def centre_of(taxel: int) -> tuple[float, float]:
    """Position (x, y) of the centre of a taxel's cell, in mm."""
    row, column = divmod(taxel - 1, 3)
    return (column - 1) * PITCH, (1 - row) * PITCH


def moduli(poisson_ratio: float, share_of_c01: float = 0.0) -> dict[str, float]:
    """Material parameters of the scene for the paper's Young's modulus E and a Poisson ratio nu: c10 + c01 = mu / 2 = E
    / (4 (1 + nu)), in MPa."""
    half = YOUNGS_MODULUS / (4 * (1 + poisson_ratio))
    return {"c10": (1 - share_of_c01) * half, "c01": share_of_c01 * half, "poisson_ratio": poisson_ratio}
