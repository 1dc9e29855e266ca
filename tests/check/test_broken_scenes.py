"""Scenes that are damaged at random: whatever is wrong is a finding, never an exception."""

from __future__ import annotations

import pytest
from damaged_scenes import PAD, PLATE, damaged_bytes, damaged_tree
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_taxel import InputError, Scene, check_scene
from mitsuba_taxel.sensing.reading.runs import prepare

FEW = settings(max_examples=100)


def assert_findings_of(file) -> None:
    for finding in check_scene(file):
        assert finding.severity in ("error", "warning", "note")
        assert finding.message.endswith((".", ")")) and "\n" not in finding.message and "Traceback" not in str(finding)
        assert finding.file == file.name and 0 <= finding.line <= 1 + len(file.read_bytes().splitlines())


def is_refused(file) -> bool:
    """Whether a scene without pads cannot be read."""
    try:
        prepare(Scene.from_file(file))
    except InputError:
        return True
    return False


@pytest.mark.filterwarnings("ignore:.*nothing uses the <default>")  # which is no error
@FEW
@given(data=st.data())
def test_what_cannot_be_read_is_an_error(data, tmp_path):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_tree(data, PLATE))
    errors = [finding for finding in check_scene(file) if finding.severity == "error"]
    assert is_refused(file) == bool(errors), errors


@FEW
@given(data=st.data(), text=st.sampled_from([PLATE, PAD]))
def test_damaged_trees(data, text, tmp_path, static):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_tree(data, text))
    assert_findings_of(file)


@FEW
@given(data=st.data(), text=st.sampled_from([PLATE, PAD]))
def test_damaged_bytes(data, text, tmp_path, static):
    file = tmp_path / "scene.xml"
    file.write_bytes(damaged_bytes(data, text.encode()))
    assert_findings_of(file)
