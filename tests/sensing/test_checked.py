"""What is left out while a scene is as it was when last checked, and what is not."""

from __future__ import annotations

import numpy as np
import pytest
from plate_scenes import plate

from mitsuba_taxel import InputError, measure
from mitsuba_taxel.sensing import targets
from mitsuba_taxel.sensing.validity import checked


@pytest.fixture
def checks(monkeypatch):
    """The scenes that were checked."""
    seen: list = []
    refuse = checked.refuse_unmodelled
    monkeypatch.setattr(checked, "refuse_unmodelled", lambda scene, how: (seen.append(scene), refuse(scene, how)))
    return seen


@pytest.mark.parametrize("scattering", ["lambertian", "mirror"])
def test_a_scene_is_checked_once_and_after_each_change(llvm_mono, checks, scattering):
    live = plate(scattering=scattering).load()
    for seed in range(4):
        measure(live, points=4, seed=seed)
    assert len(checks) == 1
    parameters = llvm_mono.traverse(live)
    parameters["plate.bsdf.reflectance"] = 0.5
    parameters.update()
    measure(live, points=4)
    assert len(checks) == 2


def test_a_change_that_is_not_allowed_is_found(llvm_mono):
    """A plate in the plane of the dies."""
    live = plate().load()
    for seed in range(3):
        measure(live, points=4, seed=seed)
    parameters = llvm_mono.traverse(live)
    flat = llvm_mono.ScalarTransform4f().translate([0, 0, 0.5])
    parameters["plate.to_world"] = flat
    parameters.update()
    with pytest.raises(InputError, match="lies in its plane"):
        measure(live, points=4)


def test_mitsubas_own_walls_are_checked_each_time(llvm_mono, checks):
    scene = plate()
    scene.source["plate"]["bsdf"] = {"type": "twosided", "nested": {"type": "diffuse"}}
    live = scene.load()
    for seed in range(3):
        measure(live, points=4, seed=seed)
    assert len(checks) == 3


def test_the_number_of_points_is_that_of_the_scene_and_found_once(llvm_mono, monkeypatch):
    """Whatever was read before: other seeds and targets, or another reflectance, which is another scene."""
    pilots: list = []
    run = targets.Run
    monkeypatch.setattr(targets, "Run", lambda *how: (pilots.append(how), run(*how))[1])
    live = plate(scattering="mirror").load()
    fresh = [measure(plate(scattering="mirror").load(), target_error=error, seed=5) for error in (0.01, 0.003)]
    wanted = len(pilots)
    pilots.clear()
    kept = [measure(live, target_error=error, seed=seed) for error in (0.01, 0.003) for seed in (3, 5)]
    assert len(pilots) == wanted
    for one, other in zip(fresh, kept[1::2], strict=True):
        assert np.array_equal(one.replicates, other.replicates)
    assert kept[0].points == kept[1].points < kept[2].points == kept[3].points
    parameters = llvm_mono.traverse(live)
    parameters["plate.bsdf.reflectance"] = 0.5
    parameters.update()
    measure(live, target_error=0.01)
    assert len(pilots) > wanted
