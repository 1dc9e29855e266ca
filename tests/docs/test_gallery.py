"""The scenes of the gallery are right as they stand, and each has its picture and its place on the page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mitsuba_taxel import check_scene

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "gallery.md").read_text(encoding="utf-8")
SCENES = re.findall(r"^```\{literalinclude\} (\S+\.xml)$", PAGE, re.MULTILINE)
LIGHT = {
    "ball": {"fz": "-0.05"},
    "domes": {"fz": "-0.1"},
    "dragged_rod": {"ux": "0.01", "uz": "-0.03"},
    "fingertip": {"fz": "-0.02"},
    "free_roof": {"pressure": "0.001"},
    "hexagonal": {},
    "printed_mould": {"fz": "-0.1"},
    "real_part": {"fz": "-0.05"},
    "self_contact": {"fz": "-0.05"},
    "sheared_plate": {"ux": "0.01", "uz": "-0.01"},
}
"""Small loads, which make the check quick; `docs/draw_pictures.py` applies those of the scenes."""


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_is_right(scene):
    findings = check_scene(DOCS / scene, **LIGHT[Path(scene).stem])
    assert [finding for finding in findings if finding.severity != "note"] == []


def test_there_are_ten_scenes_each_with_a_picture():
    names = [Path(scene).stem for scene in SCENES]
    assert len(names) == 10 and re.findall(r"\]\(gallery/(\w+)\.png\)", PAGE) == names
    assert {file.stem for file in (DOCS / "gallery").glob("*.xml")} == set(names) - {"hexagonal"}


@pytest.mark.parametrize("folder", ["gallery", "pictures/plugins"])
def test_pictures_are_small(folder):
    sizes = {file.name: file.stat().st_size for file in (DOCS / folder).glob("*.png")}
    assert len(sizes) >= 10 and max(sizes.values()) < 60_000, sizes
