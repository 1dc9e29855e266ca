"""The scene of the variations is the shipped pad, with fewer packages."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import MooneyRivlin, NeoHookean, measure
from mitsuba_taxel.evidence.paper.scenes import CENTRE, CORNER, centre_of, moduli, write_scene
from mitsuba_taxel.evidence.paper.variations import choices
from mitsuba_taxel.sensing import Scene, find_scene


def test_places_of_the_taxels():
    assert [centre_of(taxel) for taxel in (1, 3, 5, 8)] == [(-3.55, 3.55), (3.55, 3.55), (0, 0), (0, -3.55)]


@pytest.mark.parametrize("ratio", [0.45, 0.499])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_moduli_at_small_strain_are_the_papers(ratio, share):
    silicone = MooneyRivlin(**moduli(ratio, share))
    assert silicone.youngs_modulus == pytest.approx(4.16)
    assert silicone.compressibility == pytest.approx(NeoHookean(4.16, ratio).compressibility)


def test_readings_are_those_of_the_shipped_pad(tmp_path):
    write_scene(tmp_path / "scene.xml", (CORNER, CENTRE))
    ours = measure(Scene(tmp_path / "scene.xml", {"cell": "cylindrical"}), points=256, seed=1)
    pad = measure(Scene(find_scene("pad.xml"), {"cell": "cylindrical"}), points=256, seed=2)
    shipped = [CORNER - 1, CENTRE - 1]
    error = np.hypot(ours.standard_error, pad.standard_error[shipped])
    assert np.all(np.abs(ours.power - pad.power[shipped]) < 4.5 * error)
    assert np.all(error < 0.01 * ours.power)


def test_every_choice_is_one_that_the_scene_takes(tmp_path):
    write_scene(tmp_path / "scene.xml", (CENTRE,))
    names = [choice.name for choice in choices()]
    assert len(set(names)) == len(names)
    for choice in choices():
        assert set(choice.values) <= set(Scene(tmp_path / "scene.xml").parameters)
