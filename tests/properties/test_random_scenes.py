"""Random scenes over all parameters are read or refused in one line, as `check_scene` foretells; see
``python tests/helpers/random_scenes.py FIRST COUNT`` for more of them than are read here."""

from __future__ import annotations

import pytest
from random_scenes import Reader, random_scene

from mitsuba_taxel import InputError, Scene, check_scene

SEEDS = range(40)


def test_a_scene_depends_on_its_seed_alone():
    assert random_scene(3) == random_scene(3) != random_scene(4)


def test_random_scenes_are_read_or_refused_in_one_line(tmp_path):
    reader = Reader(tmp_path)
    try:
        outcomes = {seed: reader.outcome(seed) for seed in SEEDS}
    finally:
        reader.end()
    for seed, about in outcomes.items():
        assert about["kind"] in ("reading", "refused", "stopped"), (seed, about)
        assert "\n" not in about.get("message", "") and about["seconds"] < 60, (seed, about)
    lit = [about for about in outcomes.values() if about["kind"] == "reading" and about["power"] > 0]
    assert len(lit) >= 0.3 * len(SEEDS)
    assert all(0 < about["error"] and about["power"] <= about["emitted"] for about in lit)


CELL = """<scene version="3.9.0">
<shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/> {pad} </shape>
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"> {sensor} </sensor> </shape>
</scene>"""
ROD = """<string name="load" value="indenter_force"/> <string name="indenter" value="cylinder"/>
<float name="indenter_radius" value="0.001"/> <float name="friction" value="0.3"/>
<vector name="force" value="0, 0, 0"/>"""
PATCH = """<string name="load" value="patch_force"/> <vector name="force" value="0.1, 0.1, -0.1"/>
<float name="patch_width" value="1"/> <float name="patch_depth" value="0.001"/> <string name="prony" value="0.9 1"/>"""
ENDS = '<vector name="force" value="0, 0, -200"/>'
RUBBED = """<string name="load" value="indenter_displacement"/> <float name="indenter_radius" value="2"/>
<float name="friction" value="20"/> <vector name="displacement" value="0, 0, -0.1"/>"""


@pytest.mark.parametrize(
    ("pad", "sensor", "message"),
    [
        (ROD, "", "indenter_radius = 0.001 is not allowed: more than 60000 elements"),
        (PATCH, "", r"a traction of 173 MPa on a patch of 1 x 0.001 mm is not allowed"),
        (ENDS, '<float name="width" value="9"/>', r"width = 9 of the phototransistor is not allowed"),
    ],
    ids=["rod of 1 µm", "patch of 1 µm", "an end of the path and a wrong part"],
)
def test_what_had_no_end_or_came_late_is_refused_at_once(tmp_path, monkeypatch, pad, sensor, message):
    """Before a pad is solved."""

    def solve(*_, **__):
        raise AssertionError("a pad is solved")

    monkeypatch.setattr("mitsuba_taxel.mechanics.equilibrium.loaded_pad.LoadedPad.solve_after", solve)
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "solutions"))
    (tmp_path / "scene.xml").write_text(CELL.format(pad=pad, sensor=sensor))
    with pytest.raises(InputError, match=message):
        Scene(tmp_path / "scene.xml").load()
    assert any(finding.severity == "error" for finding in check_scene(tmp_path / "scene.xml"))


def test_friction_beyond_what_is_common_is_odd(tmp_path, monkeypatch):
    monkeypatch.setattr("mitsuba_taxel.check.scene.check_prepared", lambda scene, file: [])
    (tmp_path / "scene.xml").write_text(CELL.format(pad=RUBBED, sensor=""))
    messages = [finding.message for finding in check_scene(tmp_path / "scene.xml")]
    assert "friction = 20 of deformable_pad is unusual: 0 to 2 is common." in messages
