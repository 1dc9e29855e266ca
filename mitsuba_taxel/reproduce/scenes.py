"""The paper's sensor as a scene on disk, with every choice that the paper leaves open as a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mitsuba_taxel.base.atomic import write_text
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.pads.pad import DEFAULT_MESH_SIZE

PITCH = 3.55
YOUNGS_MODULUS, POISSON_RATIO = NeoHookean().youngs_modulus, NeoHookean().poisson_ratio
CORNER, CENTRE = 3, 5
"""The taxels of the variations: the corner (+x, +y) and the centre."""

_SCENE = """\
<!-- The paper's pad of 3 x 3 cells; only the cells {cells} have photo-reflectors and are read. -->
<scene version="3.9.0">
    <default name="cell" value="parallelepiped"/>
    <default name="fx" value="0"/>
    <default name="fy" value="0"/>
    <default name="fz" value="0"/>
    <default name="c10" value="{c10}"/>
    <default name="c01" value="0"/>
    <default name="poisson_ratio" value="{poisson_ratio}"/>
    <default name="mesh_size" value="{mesh_size}"/>
    <default name="spacing" value="0.9"/>
    <default name="hole" value="0.1"/>
    <default name="law" value="uniform_solid_angle"/>
    <default name="detector_width" value="0.52"/>
    <default name="detector_depth" value="0.3"/>
    <default name="scattering" value="isotropic"/>
    <default name="body_reflectance" value="0"/>
    <default name="integrator" value="taxel_tracer"/>

    <integrator type="$integrator"/>

    <shape type="deformable_pad">
        <string name="cell" value="$cell"/>
        <string name="read_cells" value="{cells}"/>
        <!-- With c01 = 0 it is the neo-Hookean law. -->
        <string name="material" value="mooney_rivlin"/>
        <float name="c10" value="$c10"/>
        <float name="c01" value="$c01"/>
        <float name="poisson_ratio" value="$poisson_ratio"/>
        <float name="mesh_size" value="$mesh_size"/>
        <vector name="force" value="$fx, $fy, $fz"/>
        <bsdf type="region">
            <bsdf name="roof" type="wall"> <string name="scattering" value="$scattering"/> </bsdf>
        </bsdf>
    </shape>
{reflectors}
    <!-- The board, in the plane of the pad's bottom. -->
    <shape type="rectangle">
        <transform name="to_world"><scale value="10"/></transform>
        <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
    </shape>
</scene>
"""

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


def write_scene(file: Path, taxels: Sequence[int]) -> None:
    """Write the scene with photo-reflectors only in the cells ``taxels``, read in this order."""
    reflectors = "".join(_REFLECTOR.format(x=x, y=y) for x, y in map(centre_of, taxels))
    cells = ", ".join(map(str, taxels))
    c10 = moduli(POISSON_RATIO)["c10"]
    values = {"c10": c10, "poisson_ratio": POISSON_RATIO, "mesh_size": DEFAULT_MESH_SIZE}
    write_text(file, _SCENE.format(cells=cells, reflectors=reflectors, **values))


def centre_of(taxel: int) -> tuple[float, float]:
    """Centre of the cell of a taxel, in mm."""
    row, column = divmod(taxel - 1, 3)
    return (column - 1) * PITCH, (1 - row) * PITCH


def moduli(poisson_ratio: float, share_of_c01: float = 0.0) -> dict[str, float]:
    """Parameters of the scene for the paper's Young's modulus: c10 + c01 = mu / 2 = E / (4 (1 + nu)), in MPa."""
    half = YOUNGS_MODULUS / (4 * (1 + poisson_ratio))
    return {"c10": (1 - share_of_c01) * half, "c01": share_of_c01 * half, "poisson_ratio": poisson_ratio}
