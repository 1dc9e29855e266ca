"""`taxel sweep` of a study file with several scenes."""

from __future__ import annotations

import json

STUDY = """points = 32
[[scenes]]
name = "near"
scene = "plate.xml"
vary = { z = [0.6, 0.7] }
[[scenes]]
name = "law"
scene = "plate.xml"
vary = { law = ["lambertian", "uniform_solid_angle"] }
"""


def test_several_scenes_are_shown_one_by_one(taxel, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    ended = taxel("sweep", "study.toml", "-o", "folder")
    assert ended.returncode == 0, ended.stderr
    near, law = (ended.stdout.index(f"\n{name}:\nPower over ") for name in ("near", "law"))
    assert near < law
    again = json.loads(taxel("sweep", "study.toml", "-o", "folder", "--json").stdout)
    assert {name: scene["sensitivity"] for name, scene in again["scenes"].items()} == {"near": [], "law": []}
