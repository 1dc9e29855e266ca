"""The unit of a scene's parameter is that of what it stands for, whatever it is called."""

from __future__ import annotations

import pytest

from mitsuba_taxel.sensing.scene.finding import shipped_scenes
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters

pytestmark = pytest.mark.quick

SCENE = """<scene version="3.9.0">
<include filename="inner.xml"/>
<shape type="deformable_pad"> <vector name="force" value="$a, -$b 0"/> <vector name="print_direction" value="$free"/>
  <float name="youngs_modulus" value="$width"/> <float name="pitch" value="$both"/> <integer name="rows" value="$n"/>
  <transform name="to_world"> <translate x="$x"/> <rotate z="1" angle="$turn"/> <scale value="$s"/> </transform>
</shape>
<shape type="ply"> <float name="pitch" value="$c"/> </shape>
</scene>"""
INNER = """<scene version="3.9.0"> <emitter type="annular_led"> <float name="wavelength" value="$nm"/>
<float name="power" value="$both"/> </emitter> <bsdf type="wall"> <float name="reflectance" value="$rho"/> </bsdf>
</scene>"""


def test_units(tmp_path):
    (tmp_path / "scene.xml").write_text(SCENE)
    (tmp_path / "inner.xml").write_text(INNER)
    known = {"a": "N", "b": "N", "width": "MPa", "x": "mm", "turn": "degrees", "nm": "nm", "rho": "1"}
    assert units_of_parameters(tmp_path / "scene.xml") == known


def test_of_shipped_scenes():
    plate, pad = (units_of_parameters(shipped_scenes() / name) for name in ("plate.xml", "pad.xml"))
    assert plate["z"] == "mm" and "width" not in plate, "it scales a rectangle"
    assert pad["fz"] == "N" and pad["youngs_modulus"] == "MPa" and pad["poisson_ratio"] == "1"
