"""The stated error of an image by the finite elements, against images on finer elements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_scene import led, scene

from mitsuba_taxel.sensing.camera import _local_mean, camera_image
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

COARSE, FINE = 2.4, 0.8
"""Sizes of elements in mm; the error on the fine ones is a fifth of that on the coarse ones."""


def pressed(size, x, depth, radius):
    ball = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": radius, "indenter_x": x}
    block = {"width": 12.0, "depth": 12.0, "youngs_modulus": 0.2, "mesh_size": size}
    return scene(led(5.0, -4.0, -3.0), pixels=(60, 45), load=ball | block | {"displacement": [0.0, 0.0, -depth]}).load()


def rms(values):
    return math.sqrt(np.square(values).mean())


@pytest.mark.parametrize(("x", "depth", "radius"), [(0.0, 0.4, 4.0), (2.0, 0.6, 3.0), (0.0, 0.2, 4.0)])
def test_the_stated_error_of_the_elements_is_that_to_finer_elements(llvm_mono, x, depth, radius):
    live, reference = (pressed(size, x, depth, radius) for size in (COARSE, FINE))
    image, finer = (camera_image(own, samples=4) for own in (live, reference))
    # The same random numbers: most of the noise of the light cancels in the difference.
    used = image.coat & finer.coat & (image.radiance[..., 0] > 0)
    difference = (image.radiance - finer.radiance)[used]
    true, stated = rms(difference / image.radiance[used]), image.relative_mechanics_error
    assert 0.5 * stated < true < 1.5 * stated
    total = np.hypot(image.standard_error, image.mechanics_error)[used]
    assert (np.abs(difference) < 2 * total).mean() > 0.95
    assert image.relative_total_error == pytest.approx(math.hypot(stated, image.relative_error))
    # The force of the indenter has its error, too.
    forces = [pad_results([pad.state for pad in deformed_pads(own)])["reaction_fz"] for own in (live, reference)]
    assert 0 < abs(forces[0].value - forces[1].value) < 2 * forces[0].error


def test_an_unloaded_coat_has_no_error_of_the_elements(llvm_mono):
    image = camera_image(scene(led(0.0, 0.0, -3.0)), samples=1)
    assert not image.mechanics_error.any() and image.relative_total_error == image.relative_error > 0


def test_a_target_is_that_of_both_errors_together(llvm_mono):
    live = pressed(COARSE, 2.0, 0.6, 3.0)
    pilot = camera_image(live, samples=16)
    target = 1.5 * pilot.relative_mechanics_error
    assert camera_image(live, target_error=target).relative_total_error <= target


@pytest.mark.parametrize(("part", "is_reached"), [(1.02, False), (1.2, True)])
def test_a_target_just_above_the_error_of_the_elements_needs_few_samples(llvm_mono, part, is_reached):
    live = pressed(COARSE, 2.0, 0.6, 3.0)
    pilot = camera_image(live, samples=16)
    target = part * pilot.relative_mechanics_error
    image = camera_image(live, target_error=target)
    # Within 5 % of the target, light that meets it alone is enough; otherwise it has what the elements leave.
    left = target if not is_reached else math.sqrt(target**2 - pilot.relative_mechanics_error**2)
    assert image.samples <= 16 * max(1, 4 * (pilot.relative_error / left) ** 2)
    assert image.relative_error <= left and (image.relative_total_error <= target) is is_reached


def test_a_local_mean_is_that_of_the_pixels_of_the_coat_nearby():
    generator = np.random.default_rng(0)
    values, coat, reach = generator.random((7, 9, 2)), generator.random((7, 9)) > 0.4, 2
    mean = _local_mean(values, coat, reach)
    for row, column in np.ndindex(coat.shape):
        near = np.s_[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]
        expected = values[near][coat[near]].mean(axis=0) if coat[row, column] else values[row, column]
        assert mean[row, column] == pytest.approx(expected)
