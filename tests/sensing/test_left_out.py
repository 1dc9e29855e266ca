"""A parameter without a value leaves out what uses it."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import InputError, Scene, check_scene, measure
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.derivatives.derivable import without_derivative
from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of

ROOF = '<string name="profile" value="1 0.6; $r2 $z2; 0 1"/> <vector'


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "cell.xml"
    text = one_cell(cell="$shape", scattering="isotropic", shape="profile", r2=0.7, z2=0.8, fz=0)
    path.write_text(text.replace("<vector", ROOF, 1))
    return path


def test_what_uses_it_is_left_out(file, tmp_path):
    """The scene is that without the element, to the bit; also written, checked, and differentiated."""
    given = {"shape": "cylindrical", "r2": "none"}
    (tmp_path / "plain.xml").write_text(one_cell(cell="cylindrical", scattering="isotropic", fz=0))
    found, plain = (measure(scene) for scene in (Scene(file, given), Scene(tmp_path / "plain.xml")))
    assert np.array_equal(found.power, plain.power)
    Scene(file, given).write_xml(tmp_path / "written.xml")
    assert "profile" not in (tmp_path / "written.xml").read_text()
    assert not [finding for finding in check_scene(file, **given) if finding.severity == "error"]
    assert without_derivative(Scene(file, given), ["r2", "z2"]) == {}
    by = measure(Scene(file, given), derivatives=["r2", "fz"]).derivatives
    assert not by.values[:, 0].any() and by.values[:, 1].all()


def test_a_value_that_does_not_apply_is_refused(file):
    said = str(refusal_of(Scene(file, {"shape": "cylindrical"})))
    own = "(parameter shape = cylindrical, r2 = 0.7, z2 = 0.8)"
    assert said == f"profile is not allowed for cell = 'cylindrical', only for 'profile' {own}."
    assert refusal_of(Scene(file, {"shape": "cylindrical", "z2": "none"})) is None
    assert str(refusal_of(Scene(file, {"r2": "none"}))).startswith("profile is missing")
    assert Pad("cylindrical").profile is None


def test_what_is_included_cannot_be_left_out(file, tmp_path):
    (tmp_path / "around.xml").write_text(
        f'<scene version="3.9.0"> <default name="r2" value="0.7"/> <include filename="{file.name}"/> </scene>'
    )
    with pytest.raises(InputError, match="r2 = none is not allowed: a file that around.xml includes uses it"):
        Scene(tmp_path / "around.xml", {"r2": "none"}).load()
