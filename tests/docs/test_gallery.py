"""The scenes of the gallery are right as they stand, and each has its picture and its place on the page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mitsuba_taxel import check_scene

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "gallery.md").read_text(encoding="utf-8")
SCENES = re.findall(r"^```\{literalinclude\} (\S+\.xml)$", PAGE, re.MULTILINE)
UNLOADED = {
    "dragged_rod": {"ux": "0", "uz": "0"},
    "free_roof": {"pressure": "0"},
    "sheared_plate": {"ux": "0", "uz": "0"},
}
"""Loads that need no solution, others are forces `fz`; `docs/draw_pictures.py` applies the loads of the scenes."""


@pytest.mark.parametrize("scene", [scene for scene in SCENES if "scenes/" not in scene])
def test_a_scene_is_right(scene):
    findings = check_scene(DOCS / scene, **UNLOADED.get(Path(scene).stem, {"fz": "0"}))
    assert [finding for finding in findings if finding.severity != "note"] == []


def test_there_are_eleven_scenes_each_with_a_picture():
    names = [Path(scene).stem for scene in SCENES]
    assert len(names) == 11 and re.findall(r"\]\(gallery/(\w+)\.png\)", PAGE) == names
    assert {file.stem for file in (DOCS / "gallery").glob("*.xml")} == set(names) - {"hexagonal"}


@pytest.mark.parametrize("folder", ["gallery", "pictures/plugins"])
def test_pictures_are_small(folder):
    sizes = {file.name: file.stat().st_size for file in (DOCS / folder).glob("*.png")}
    assert len(sizes) >= 10 and max(sizes.values()) < 60_000, sizes
