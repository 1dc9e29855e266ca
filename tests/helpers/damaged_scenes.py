"""Scenes to damage, and ways to damage them at random."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

from hypothesis import strategies as st

EXTREMES = [
    "nan", "inf", "-inf", "1e308", "-1e308", "1e38", "1e-38", "1e-308", "1e400", "0", "-0.0", "-1", "1", "2147483648",
    "4294967296", "99999999999999999999", "100000000", "", " ", "abc", "true", "0, 0, nan", "1e308, 1e308, 1e308",
    "0, 0, -1e30", "$nothing", "$z", "\u00e9\u4e2d", "../..", "/", "a" * 5000, "1 2 3 4", "0.5 nm", "1e-3", "1000",
]  # fmt: skip

PLATE = """<scene version="3.9.0">
<default name="z" value="0.7"/>
<integrator type="taxel_tracer"> <integer name="max_depth" value="8"/> </integrator>
<shape type="photo_reflector">
  <integer name="rows" value="1"/> <integer name="columns" value="2"/> <float name="pitch" value="3.55"/>
  <float name="spacing" value="0.9"/> <vector name="body" value="1.46, 1.06, 0.5"/>
  <emitter type="annular_led"> <float name="power" value="1"/> <float name="size" value="0.25"/>
    <float name="hole" value="0.1"/> <float name="wavelength" value="925"/>
    <string name="law" value="lambertian"/> </emitter>
  <sensor type="phototransistor"> <float name="width" value="0.52"/> <float name="depth" value="0.3"/>
    <string name="response" value="cosine_power"/> <float name="exponent" value="2"/>
    <film type="hdrfilm"> <integer name="width" value="2"/> <integer name="height" value="2"/>
      <rfilter type="box"/> <string name="pixel_format" value="luminance"/> </film>
    <sampler type="owen_sobol"> <integer name="sample_count" value="16"/> </sampler> </sensor>
  <bsdf type="wall"> <float name="reflectance" value="0.3"/> </bsdf>
</shape>
<shape type="rectangle"> <transform name="to_world"> <rotate x="1" angle="180"/> <scale x="4" y="4"/>
    <translate x="0" y="0" z="0.5"/> <translate z="$z"/> </transform>
  <bsdf type="wall"> <string name="scattering" value="lambertian"/> <float name="reflectance" value="0.8"/> </bsdf>
</shape>
</scene>"""

PAD = """<scene version="3.9.0">
<default name="z" value="-0.5"/>
<integrator type="taxel_tracer"/>
<shape type="deformable_pad">
  <string name="cell" value="cylindrical"/> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
  <float name="pitch" value="3.55"/> <float name="wall" value="1"/> <float name="height" value="3"/>
  <float name="cell_size" value="2.55"/> <float name="cell_height" value="1.3"/>
  <string name="material" value="neo_hookean"/> <float name="youngs_modulus" value="4"/>
  <float name="poisson_ratio" value="0.49"/> <string name="load" value="spread_force"/>
  <vector name="force" value="0, 0, $z"/> <float name="mesh_size" value="1.25"/> <integer name="subdivision" value="2"/>
  <string name="read_cells" value="1"/> <transform name="to_world"> <translate z="0"/> </transform>
  <bsdf type="region"> <bsdf name="roof" type="wall"> <string name="scattering" value="mirror"/> </bsdf>
    <bsdf name="side" type="wall"> <float name="reflectance" value="0.5"/> </bsdf> </bsdf>
</shape>
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
</scene>"""


def damaged_tree(data: st.DataObject, text: str) -> bytes:
    """A scene of which elements are taken out, put elsewhere, named otherwise, or given other values."""
    root = ElementTree.fromstring(text)
    for _ in range(data.draw(st.integers(1, 3))):
        parents = {child: parent for parent in root.iter() for child in parent}
        element = data.draw(st.sampled_from(list(parents)))
        what = data.draw(st.sampled_from(["value"] * 6 + ["remove", "double", "move", "tag", "attribute", "drop"]))
        if what == "remove":
            parents[element].remove(element)
        elif what == "double":
            parents[element].append(element)
        elif what == "move":
            target = data.draw(st.sampled_from(list(root.iter())))
            if element not in target.iter() and target not in element.iter():
                parents[element].remove(element)
                target.append(element)
        elif what == "tag":
            element.tag = data.draw(st.sampled_from(sorted({other.tag for other in root.iter()} | {"include", "ref"})))
        elif element.attrib:
            valued = [name for name in element.attrib if name not in ("name", "type")]
            name = data.draw(st.sampled_from((valued if what == "value" and valued else None) or list(element.attrib)))
            if what == "drop":
                del element.attrib[name]
            elif what == "attribute":
                element.set(data.draw(st.sampled_from(["name", "type", "value", "id", "x"])), element.attrib.pop(name))
            else:
                element.set(name, data.draw(st.sampled_from(EXTREMES)))
    return ElementTree.tostring(root, encoding="utf-8")


def damaged_bytes(data: st.DataObject, content: bytes) -> bytes:
    """Bytes of which some are changed, or the end is missing."""
    mutable = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        mutable[data.draw(st.integers(0, len(mutable) - 1))] = data.draw(st.integers(0, 255))
    return bytes(mutable[: data.draw(st.one_of(st.just(len(mutable)), st.integers(0, len(mutable))))])
