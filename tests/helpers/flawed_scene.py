"""Sound scenes of a pad and of a plate, and changes of their text."""

from __future__ import annotations

from mitsuba_taxel import check_scene

PAD = """<scene version="3.9.0">
<default name="fz" value="-5"/>
<integrator type="taxel_tracer"/>
<shape type="deformable_pad">
  <string name="cell" value="cylindrical"/>
  <float name="youngs_modulus" value="4.16"/>
  <vector name="force" value="0, 0, $fz"/>
  <bsdf type="region">
    <bsdf name="roof" type="wall"> <float name="reflectance" value="0.9"/> </bsdf>
  </bsdf>
</shape>
<shape type="photo_reflector">
  <integer name="rows" value="3"/> <integer name="columns" value="3"/>
  <emitter type="annular_led">
  </emitter>
  <sensor type="phototransistor">
  </sensor>
</shape>
<shape type="rectangle">
  <transform name="to_world"> <scale value="10"/> </transform>
  <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
</shape>
</scene>"""


PLATE = """<scene version="3.9.0">
<default name="z" value="0.7"/>
<integrator type="taxel_tracer"/>
<shape type="rectangle" id="led">
  <transform name="to_world"> <scale value="0.2"/> <translate x="-0.45"/> </transform>
  <emitter type="annular_led"/>
  <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
</shape>
<shape type="rectangle" id="phototransistor">
  <transform name="to_world"> <scale value="0.4"/> <translate x="0.45"/> </transform>
  <sensor type="phototransistor"> <film type="hdrfilm"> <integer name="width" value="1"/>
    <integer name="height" value="1"/> <rfilter type="box"/> <string name="pixel_format" value="luminance"/> </film>
    <sampler type="owen_sobol"/> </sensor>
  <bsdf type="wall"> <string name="scattering" value="absorbing"/> </bsdf>
</shape>
<shape type="rectangle" id="plate">
  <transform name="to_world"> <rotate x="1" angle="180"/> <scale value="4"/> <translate z="$z"/> </transform>
  <bsdf type="wall">
    <string name="scattering" value="mirror"/>
  </bsdf>
</shape>
</scene>"""


IN_PAD = ("<bsdf type=", "{}<bsdf type=")


IN_REFLECTOR = ("<emitter type=", "{}<emitter type=")


IN_LED = ("  </emitter>", "{}  </emitter>")


IN_SENSOR = ("  </sensor>", "{}  </sensor>")


AT_END = ("</scene>", "{}</scene>")


PACKAGE = """<shape type="photo_reflector"> <transform name="to_world"> <translate x="{}"/> </transform>
<emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>"""


def change(text: str, place: tuple[str, str], content: str) -> str:
    assert place[0] in text
    return text.replace(place[0], place[1].format(content), 1)


def check(tmp_path, text: str, **parameters):
    file = tmp_path / "scene.xml"
    file.write_text(text)
    return check_scene(file, **parameters)


def parameter(name: str, value: object, tag: str = "float") -> str:
    return f'<{tag} name="{name}" value="{value}"/>'
