"""A camera behind a curved pad from a file of the user, whose coat is named by rules."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from camera_scene import CLEAR, COAT, DISTANCE, FIELD, HEIGHT, led

from mitsuba_taxel import InputError
from mitsuba_taxel.pads import PadFile
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.camera_view import view_of
from mitsuba_taxel.sensing.marker_flow import has_markers
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

import mitsuba as mi  # isort: skip

A, B, BASE, RISE = 8.0, 6.0, 1.0, 3.0
"""Half axes of the elliptic foot of a fingertip, height of its upright side, and rise of its dome, in mm."""
RULES = """
[[rule]]
region = "bottom"
below = 0.01
[[rule]]
region = "top"
above = 1.0
"""


def fingertip(rings=10, around=40):
    """An upright side on an elliptic foot, and a dome of height BASE + RISE (1 - r^2), as a closed surface."""
    angle = 2 * np.pi * np.arange(around) / around
    rim = np.stack([A * np.cos(angle), B * np.sin(angle)], axis=1)
    radius = np.arange(1, rings + 1) / rings
    dome = [np.column_stack([r * rim, np.full(around, BASE + RISE * (1 - r**2))]) for r in radius]
    foot = np.column_stack([rim, np.zeros(around)])
    vertices = np.concatenate([[[0, 0, BASE + RISE]], *dome, foot, [[0, 0, 0]]])
    here, after = np.arange(around), (np.arange(around) + 1) % around
    triangles = [np.column_stack([0 * here, 1 + here, 1 + after])]
    for start in 1 + around * np.arange(rings):
        low = start + around
        triangles.append(np.column_stack([start + here, low + here, low + after]))
        triangles.append(np.column_stack([start + here, low + after, start + after]))
    last = 1 + around * rings
    triangles.append(np.column_stack([0 * here + len(vertices) - 1, last + after, last + here]))
    return trimesh.Trimesh(vertices, np.concatenate(triangles), process=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fingertip")
    fingertip().export(folder / "fingertip.stl")
    (folder / "fingertip.toml").write_text(RULES, "utf-8")
    return folder


def scene(folder, **load):
    pad = {"type": "deformable_pad", "filename": str(folder / "fingertip.stl"), "youngs_modulus": 0.2, "mesh_size": 2.0}
    pad |= {"regions": str(folder / "fingertip.toml"), **load}
    pad["bsdf"] = {"type": "region", "top": COAT, "bottom": CLEAR, "outer": CLEAR}
    film = {"type": "hdrfilm", "width": 80, "height": 60, "rfilter": {"type": "box"}, "pixel_format": "luminance"}
    place = mi.ScalarTransform4f().look_at([0, 0, HEIGHT - DISTANCE], [0, 0, 0], [0, 1, 0])
    camera = {"type": "perspective", "fov": 2 * np.degrees(np.arctan(0.5 * FIELD / DISTANCE)), "to_world": place}
    parts = {"type": "scene", "integrator": {"type": "path"}, "pad": pad, "camera": camera | {"film": film}}
    return Scene(parts | {"light": led(12.0, 9.0, -6.0)})


def test_the_camera_sees_the_dome_of_the_file(llvm_mono, folder):
    view = view_of(scene(folder).load())
    x, y, z = view.points[view.coat].T
    # Flat triangles of the file lie below the dome by less than their sagitta.
    below = BASE + RISE * (1 - (x / A) ** 2 - (y / B) ** 2) - z
    assert -0.02 < below.min() and below.max() < 0.06 and np.abs(below).mean() < 0.03
    # All of the dome is seen: its foot is an ellipse, with the perspective of its rim.
    pixels = np.pi * A * B * (80 / FIELD * DISTANCE / (DISTANCE - HEIGHT + BASE)) ** 2
    assert view.coat.sum() == pytest.approx(pixels, rel=0.02)


def test_a_ball_presses_on_the_fingertip(llvm_mono, folder):
    ball = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": 3.0}
    live = scene(folder, **ball, displacement=[0.0, 0.0, -0.3]).load()
    view = view_of(live)
    assert not has_markers(live) and np.nanmin(view.displacement[..., 2]) == pytest.approx(-0.3, abs=0.02)
    row, column = np.unravel_index(np.nanargmax(view.contact_pressure), view.depth.shape)
    assert (row, column) == (pytest.approx(29.5, abs=1.6), pytest.approx(39.5, abs=1.6))
    # The pressure that the pixels see adds up to the force; the dome is almost plane below the ball.
    force = -pad_results([pad.state for pad in deformed_pads(live)], with_errors=False)["reaction_fz"].value
    rest = view.points - view.displacement
    area = np.abs(np.cross(np.gradient(rest, axis=1), np.gradient(rest, axis=0))[..., 2])
    assert np.nansum(view.contact_pressure * area) == pytest.approx(force, rel=0.05)


def test_a_pad_without_cells_needs_a_rule_for_its_coat(folder):
    box = trimesh.creation.box((8.0, 8.0, 4.0))
    box.apply_translation([0, 0, 2])
    box.export(folder / "box.stl")
    with pytest.raises(InputError, match="it has no cell: .* nor a top as the coat of a pad without cells"):
        PadFile(folder / "box.stl").mesh(2.0)
    (folder / "coat.toml").write_text('[[rule]]\nregion = "top"\nabove = 3.99\n', "utf-8")
    pad = PadFile(folder / "box.stl", folder / "coat.toml")
    mesh = pad.mesh(2.0)
    assert not mesh.face_cell.any() and pad.default_mesh_size == pytest.approx(0.3 * 4)
    top = mesh.points[mesh.faces[mesh.face_region == REGIONS["top"]]]
    assert top[..., 2] == pytest.approx(4.0)
