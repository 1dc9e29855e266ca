"""A pad of one cell over its photo-reflector as a scene file: coarse elements, and as parameters what a test varies."""

from __future__ import annotations

SCENE = """<scene version="3.9.0">
    {defaults} {integrator}
    <shape type="deformable_pad">
        <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <string name="cell" value="{cell}"/> <float name="mesh_size" value="{mesh_size}"/>
        {modulus} <vector name="force" value="{force}"/>
        <bsdf type="region">
            <bsdf name="roof" type="wall"> <string name="scattering" value="{scattering}"/> </bsdf>
        </bsdf>
    </shape>
    <shape type="photo_reflector">
        <emitter type="annular_led"> {power} </emitter> <sensor type="phototransistor"/>
    </shape>
</scene>"""


def one_cell(
    *,
    cell: str = "parallelepiped",
    mesh_size: object = 2.5,
    scattering: str = "lambertian",
    integrator: str = "",
    **parameters: object,
) -> str:
    """The scene's XML.

    ``parameters`` are those of the scene with their defaults: ``fx``, ``fz``, ``youngs_modulus``, ``led_power``, and
    others that one of the words above names as ``$name``. An empty integrator is left to the choice by rule.
    """
    modulus, power = (
        f'<float name="{name}" value="${parameter}"/>' if parameter in parameters else ""
        for name, parameter in (("youngs_modulus", "youngs_modulus"), ("power", "led_power"))
    )
    return SCENE.format(
        defaults=" ".join(f'<default name="{name}" value="{value}"/>' for name, value in parameters.items()),
        integrator=f'<integrator type="{integrator}"/>' if integrator else "",
        cell=cell,
        mesh_size=mesh_size,
        modulus=modulus,
        force=", ".join(f"${name}" if name in parameters else "0" for name in ("fx", "fy", "fz")),
        scattering=scattering,
        power=power,
    )
