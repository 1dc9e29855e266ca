"""Differences of readings by paths through material points, against light without random numbers."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.kernels.paths.paired_paths import PairedState, trace_difference
from mitsuba_taxel.sensing.reading.runs import Run, prepare
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.sensing.scene.taxels import taxels_of

POINTS, REPLICATES = 1024, 32


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    """Two loads of one cell of a kind."""
    folder = tmp_path_factory.mktemp("paired")

    def loaded(cell, scattering):
        file = folder / f"{cell}_{scattering}.xml"
        text = one_cell(cell=cell, mesh_size=2.0, scattering=scattering, fz=0)
        if scattering == "rough_mirror":
            text = text.replace('<bsdf name="roof" type="wall">', '<bsdf name="roof" type="wall">' + ROUGH)
        file.write_text(text)
        return [prepare(Scene(file, {"fz": force})) for force in ("-0.2", "-0.8")]

    return loaded


ROUGH = ' <float name="rms_slope" value="5"/>'


def difference(first, second, seed=0, points=POINTS):
    states = [PairedState(ready.scene, deformed_pads(ready.scene)[0]) for ready in (first, second)]
    (pair,) = taxels_of(first.scene)
    return trace_difference(*states, pair, points, seed, REPLICATES)[:, 0]


@pytest.mark.parametrize(("cell", "scattering"), [("spherical", "lambertian"), ("parallelepiped", "isotropic")])
def test_differences_agree_with_light_without_random_numbers(scenes, cell, scattering):
    """A Z-test at 4 standard deviations (false alarms 6e-5), and noise of at most 3 % of the difference."""
    first, second = scenes(cell, scattering)
    change = difference(first, second)
    exact = [measure(ready, mechanics_error=False) for ready in (first, second)]
    assert exact[0].points == 0
    truth = (exact[1].power - exact[0].power)[0]
    error = np.hypot(standard_error(change), 2e-4 * abs(truth))  # the patches of both states are the same
    assert abs(change.mean() - truth) < 4 * error
    assert standard_error(change) < 0.03 * abs(truth)


def test_differences_of_a_rough_mirror_agree_with_readings(scenes):
    """A Z-test at 4 standard deviations (false alarms 6e-5) against 16 times as many paths with shared numbers."""
    first, second = scenes("spherical", "rough_mirror")
    change, powers = difference(first, second, points=256), []
    for ready in (first, second):
        run = Run(ready, 1)
        run.extend_to(4096)
        powers.append(run.powers[:, 0])
    plain = powers[1] - powers[0]
    error = np.hypot(standard_error(change), standard_error(plain))
    assert abs(change.mean() - plain.mean()) < 4 * error
    assert standard_error(change) < 0.1 * abs(change.mean())


def test_differences_change_sign_with_the_order_of_the_states(scenes):
    first, second = scenes("spherical", "lambertian")
    forward, back = difference(first, second, points=64), difference(second, first, points=64)
    np.testing.assert_allclose(forward, -back, rtol=1e-4, atol=1e-9)
    assert np.abs(difference(first, first, points=64)).max() < 1e-6 * np.abs(forward).max()
