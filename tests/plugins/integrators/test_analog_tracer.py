"""Cells that reflect everything, and one that nearly closes: as rays that are released and counted say."""

from __future__ import annotations

import numpy as np
import pytest
from plate_scenes import ABSORBING, BODY_TOP, WHITE, closed_cell, soft_sensor

from mitsuba_taxel import Scene, Wall, measure


def test_a_closed_white_cell_agrees_with_counted_rays(llvm_mono, agree):
    """All light ends on the absorbing package; how much of it on the phototransistor, counting rays tells as well."""
    ours = measure(closed_cell(body=ABSORBING), points=1 << 13, seed=1)
    theirs = measure(closed_cell(body=ABSORBING, integrator="analog_tracer"), points=1 << 16, seed=2)
    assert max(ours.relative_error, theirs.relative_error) < 4e-3
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


def test_a_cell_that_only_led_and_phototransistor_absorb_in_agrees_with_counted_rays(llvm_mono, agree):
    """Some hundred reflections on a path."""
    cover = {"type": "region", "body": WHITE}
    ours = measure(closed_cell(body=cover), points=1 << 9, seed=3)
    theirs = measure(closed_cell(body=cover, integrator="analog_tracer"), points=1 << 10, seed=4)
    assert max(ours.relative_error, theirs.relative_error) < 1e-2
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize("strategy", ["all", "unidirectional_hits"])
def test_all_light_ends_on_the_phototransistor_if_nothing_else_absorbs(llvm_mono, agree, strategy):
    """1 W: nothing is lost in the corners and edges of the cell in hundreds of reflections."""
    cover = {"type": "region", "body": WHITE, "led": WHITE}
    reading = measure(closed_cell(body=cover, strategy=strategy), points=1 << 10, seed=5)
    assert reading.power[0] == pytest.approx(1, abs=1e-4 + 4 * reading.standard_error[0])
    assert reading.relative_error < 1e-2


@pytest.mark.parametrize("roof", ["isotropic", "lambertian"])
def test_a_cell_that_nearly_closes_agrees_with_hits_and_counted_rays(llvm_mono, agree, own_solutions, roof):
    """Pressed until its roof comes down to less than 0.1 mm above the LED's plane."""
    scene = soft_sensor(force=-1.3, roof=Wall(roof, 0.9)).scene()
    live = scene.load()
    pad = next(shape for shape in live.shapes() if hasattr(shape, "pad"))
    parameters = llvm_mono.traverse(pad)
    corners = np.array(parameters["vertex_positions"]).reshape(-1, 3)[np.array(parameters["faces"])]
    lowest = corners[np.repeat(np.array(parameters["face_region"]) == 1, 3), 2].min()
    assert BODY_TOP < lowest < BODY_TOP + 0.1

    ours = measure(scene, points=1 << 13, seed=1, mechanics_error=False)
    assert np.all(np.isfinite(ours.replicates)) and ours.relative_error < 5e-3
    assert pad.state.error is not None
    for integrator in ({"type": "taxel_tracer", "strategy": "unidirectional_hits"}, {"type": "analog_tracer"}):
        other = Scene({**scene.source, "integrator": integrator})
        theirs = measure(other, points=1 << 14, seed=2, mechanics_error=False)
        agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)
