"""What a camera sees of a loaded coat: displacement, contact pressure, and the difference to the unloaded image."""

from __future__ import annotations

import math

import numpy as np
import OpenEXR
import pytest
from camera_scene import DISTANCE, FIELD, HEIGHT, led, scene

from mitsuba_taxel import InputError
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.camera import camera_image
from mitsuba_taxel.sensing.camera_view import view_of
from mitsuba_taxel.sensing.image_file import read_image, write_image
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

LED = 8.0, 6.0, -3.0
"""Place of a light that does not hide the ball from the camera."""


def pressed(x, uz, **others):
    """A load: a ball of 4 mm radius at (x, 0), pressed by uz in mm."""
    ball = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": 4.0, "indenter_x": x}
    return ball | {"youngs_modulus": 0.2, "displacement": [0.0, 0.0, uz]} | others


def points(view):
    """Positions (H, W, 3) in mm at the centres of pixels, from their depths."""
    height, width = view.depth.shape
    along = (-(FIELD / width) * (np.arange(n) + 0.5 - n / 2) / DISTANCE for n in (width, height))
    rays_x, rays_y = np.meshgrid(*along)
    return np.stack([rays_x * view.depth, rays_y * view.depth, HEIGHT - DISTANCE + view.depth], axis=-1)


def _cross(places):
    """Area (H, W, 3) between neighbouring pixels, as a vector along the normal."""
    return np.cross(np.gradient(places, axis=1), np.gradient(places, axis=0))


@pytest.mark.parametrize(("x", "uz", "top_radius"), [(0.0, -0.4, None), (3.0, -0.4, None), (0.0, -0.2, 30.0)])
def test_displacement_leads_back_to_the_unloaded_coat(llvm_mono, x, uz, top_radius):
    load = pressed(x, uz, **({"top_radius": top_radius} if top_radius else {}))
    live = scene(led(*LED), pixels=(80, 60), load=load).load()
    view = view_of(live)
    rest = (points(view) - view.displacement)[view.coat]
    top = HEIGHT
    if top_radius is not None:
        top = HEIGHT - top_radius + np.sqrt(top_radius**2 - (rest[:, :2] ** 2).sum(axis=1))
    # Flat triangles deviate from the curved coat by their offsets at most, and from a dome at rest as well.
    (pad,) = deformed_pads(live)
    allowed = 1e-5 + (1 if top_radius is None else 2) * np.abs(pad.surface.offsets).max()
    assert allowed < 0.02 and np.abs(rest[:, 2] - top).max() < allowed
    lowest = np.nanmin(view.displacement[..., 2])
    assert lowest == pytest.approx(uz, abs=0.02)
    assert np.isnan(view.displacement[~view.coat]).all()


@pytest.mark.parametrize(("x", "uz"), [(0.0, -0.4), (3.0, -0.8)])
def test_the_pressure_that_the_pixels_see_adds_up_to_the_force(llvm_mono, x, uz):
    live = scene(led(*LED), pixels=(320, 240), load=pressed(x, uz)).load()
    view = view_of(live)
    force = pad_results([pad.state for pad in deformed_pads(live)], with_errors=False)["reaction_fz"].value
    # The pressure acts along the normal of the deformed coat, and is a force per area of the unloaded coat.
    deformed = points(view)
    normal, unloaded = (_cross(places) for places in (deformed, deformed - view.displacement))
    vertical = np.abs(normal[..., 2]) / np.linalg.norm(normal, axis=-1)
    total = np.nansum(view.contact_pressure * vertical * np.linalg.norm(unloaded, axis=-1))
    assert total == pytest.approx(-force, rel=0.02)
    # The pressure is highest below the ball.
    row, column = np.unravel_index(np.nanargmax(view.contact_pressure), view.depth.shape)
    size = FIELD / 320 * view.depth[row, column] / DISTANCE
    assert math.hypot(-size * (column + 0.5 - 160) - x, size * (row + 0.5 - 120)) < 0.5


def test_a_difference_is_that_of_two_images_with_less_noise(llvm_mono, tmp_path):
    scenes = (scene(led(*LED), load=pressed(4.0, uz)) for uz in (-0.4, 0.0))
    loaded, unloaded = (camera_image(own, samples=4, difference=True) for own in scenes)
    assert not unloaded.difference.any() and not np.nansum(np.abs(unloaded.displacement))
    assert unloaded.contact_pressure is None
    np.testing.assert_allclose(loaded.difference, loaded.radiance - unloaded.radiance, atol=1e-9)
    # Far from the ball, the two have the same noise.
    far = loaded.coat & (np.linalg.norm(loaded.displacement, axis=-1) < 0.01)
    alone = np.hypot(loaded.standard_error, unloaded.standard_error)[far]
    assert far.sum() > 100 and np.median(loaded.difference_error[far]) < 0.2 * np.median(alone)
    # The file has all of it.
    write_image(loaded, tmp_path / "image.exr", {"scene": "own"})
    image, about = read_image(tmp_path / "image.exr")
    assert about == {"scene": "own"}
    np.testing.assert_allclose(image.mechanics_error, loaded.mechanics_error, rtol=1e-6, atol=1e-9)
    for name in ("displacement", "contact_pressure", "difference", "difference_error", "depth", "coat", "radiance"):
        np.testing.assert_allclose(getattr(image, name), getattr(loaded, name), rtol=1e-6, atol=1e-9)
    with OpenEXR.File(str(tmp_path / "image.exr"), separate_channels=True) as file:
        assert {"difference.Y", "difference_error.Y", "contact_pressure", "displacement.z"} <= set(file.channels())


@pytest.mark.parametrize("changes", [{"target": (0, 0, -40)}, {"origin": (0, 0, 30)}, {"top": {"type": "diffuse"}}])
def test_a_camera_that_does_not_see_the_coat_is_refused_before_the_load_is_solved(llvm_mono, monkeypatch, changes):
    monkeypatch.setattr(Scene, "load", lambda self: pytest.fail("the load was solved"))
    with pytest.raises(InputError, match="the camera sees nothing|does not see the coat|the coat reflects nothing"):
        camera_image(scene(led(*LED), load=pressed(0.0, -0.4), **changes), samples=1)


@pytest.mark.parametrize(("x", "uz", "noted"), [(0.0, -0.2, False), (30.0, -0.2, True), (11.5, -0.1, True)])
def test_an_indenter_beside_the_pad_is_noted(llvm_mono, x, uz, noted):
    image = camera_image(scene(led(*LED), load=pressed(x, uz, mesh_size=3.0)), samples=1)
    assert bool(image.notes) is noted is (not np.nansum(np.abs(image.displacement)))
    assert not noted or "the indenter does not touch the pad" in image.notes[0]
