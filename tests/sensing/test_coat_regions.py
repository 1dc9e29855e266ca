"""The regions of a pad without cells by their own names: coat, window and side."""

from __future__ import annotations

import numpy as np
import pytest
from camera_scene import CLEAR, COAT, led, scene

from mitsuba_taxel import InputError
from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.sensing.camera import camera_image

import mitsuba as mi  # isort: skip

DARK = {"type": "diffuse", "reflectance": 0.0}


def image(**walls):
    """Image of a coat under an LED beside the block, whose light enters through its side."""
    return camera_image(scene(led(14.0, 0.0, 1.0, -60.0), pixels=(12, 9), walls=walls), samples=4).radiance


@pytest.mark.parametrize("side", [CLEAR, DARK])
def test_coat_window_and_side_are_top_bottom_and_outer(llvm_mono, side):
    if side is DARK:
        with pytest.raises(InputError, match="no light reaches the coat"):
            image(coat=COAT, window=CLEAR, side=side)
        return
    shown = image(coat=COAT, window=CLEAR, side=side)
    assert shown.max() > 0
    np.testing.assert_array_equal(shown, image(top=COAT, bottom=CLEAR, outer=side))


@pytest.mark.parametrize("other", ["top", "outer", "roof", "body"])
def test_names_of_pads_with_and_without_cells_exclude_each_other(llvm_mono, other):
    words = f"region: '{other}' is not a region beside coat or window: allowed are coat, window, side"
    with pytest.raises(InputError, match=words):
        make_plugin("region", **{"coat": mi.load_dict(COAT), other: mi.load_dict(DARK)})


@pytest.mark.parametrize("names", [("coat", "window", "side"), ("window",)])
def test_a_pad_with_cells_has_neither_coat_nor_window(llvm_mono, names):
    """Its cells would absorb, and the walls meant for their sides lie outside."""
    walls = make_plugin("region", **{name: mi.load_dict(DARK) for name in names})
    words = "coat and window are not allowed for a pad with cells: its regions are roof, side, bottom, top, outer"
    with pytest.raises(InputError, match=words):
        make_plugin("deformable_pad", cell="cylindrical", rows=1, columns=1, bsdf=walls)


def test_the_side_without_a_coat_is_that_of_cells(llvm_mono):
    assert list(make_plugin("region", side=mi.load_dict(DARK)).walls) == ["side"]
