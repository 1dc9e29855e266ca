"""Bodies from files: their distances, what they press with, and what is refused of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean
from mitsuba_taxel.mechanics.contact.solid_distance import SolidDistance
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad

RADIUS = 2.5
BALL = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
FLATNESS = RADIUS - np.abs(np.einsum("ij,ij->i", BALL.triangles[:, 0], BALL.face_normals)).min()
"""How far its triangles are inside the ball at most."""


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """The file of a ball."""
    file = tmp_path_factory.mktemp("bodies") / "ball.stl"
    BALL.export(file)
    return file


@pytest.fixture(scope="module")
def rod():
    """Distances from a square rod that is higher than wide, its edges along x, y and z."""
    box = trimesh.creation.box((2.0, 1.0, 9.0))
    return SolidDistance(box.vertices + [0, 0, 4.5], np.asarray(box.faces))


def test_distances_from_a_ball_are_right_to_what_its_triangles_are_off(ball):
    body = Indenter(file=ball)
    ways = np.random.default_rng(0).normal(size=(4000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    gaps = np.random.default_rng(1).uniform(-0.05, 0.15, len(ways))
    found = body.body.gap((RADIUS + gaps)[:, None] * ways + [0, 0, -BALL.vertices[:, 2].min()])
    off = found.size - gaps
    assert off.min() > -0.2 * FLATNESS and off.max() < 1.2 * FLATNESS
    length = np.linalg.norm(found.normal, axis=1)
    assert length.mean() == pytest.approx(1, abs=2e-3) and np.abs(length - 1).max() < 0.05
    assert (np.einsum("ij,ij->i", found.normal, ways) / length).min() > 0.998  # 3.6 degrees


def test_derivatives_are_those_of_the_distance(rod):
    places, step = np.random.default_rng(2).uniform([-1.1, -0.6, -0.1], [1.1, 0.6, 1.5], (300, 3)), 1e-5
    _, slope, bend = rod.at(places)
    for axis in range(3):
        ahead, behind = (rod.at(places + sign * step * np.eye(3)[axis]) for sign in (1, -1))
        np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * step), slope[:, axis], atol=1e-6)
        np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * step), bend[:, :, axis], atol=1e-2)


def test_what_is_inside_is_below_zero(rod):
    places = np.array([[0, 0, 1.0], [0.9, 0.4, 1.5], [0, 0, -0.2], [1.2, 0, 1], [0, 0.7, 1.5], [30, 0, 1], [0, 0, -20]])
    expected = [-0.5, -0.1, 0.2, 0.2, 0.2, 29, 20]
    np.testing.assert_allclose(rod.at(places)[0], expected, atol=0.02)
    assert rod.at(np.array([[1.3, 0.9, -1.2]]))[0] == pytest.approx(1.3, abs=0.15)  # beyond the grid
    assert len(rod.footprint(0.2)) * rod.spacing**2 == pytest.approx(2.0, rel=0.15)


def test_a_turned_body_is_the_body_turned(tmp_path):
    file = tmp_path / "rod.stl"
    trimesh.creation.box((3.0, 0.5, 1.0)).export(file)
    places = np.array([[1.4, 0, 0.2], [0, 1.4, 0.2]])
    lying, turned = (Indenter(file=file, angle=angle).body.gap(places) for angle in (0, 90))
    assert lying.size[0] < 0 < lying.size[1] and turned.size[1] < 0 < turned.size[0]
    np.testing.assert_allclose(turned.size, lying.size[::-1], atol=1e-3)


@pytest.fixture(scope="module")
def punch(tmp_path_factory):
    """The file of a round rod with a rounded edge."""
    turn = np.linspace(0, np.pi / 2, 13)
    edge = np.stack([0.7 + 0.3 * np.sin(turn), 0.3 - 0.3 * np.cos(turn)], axis=1)
    file = tmp_path_factory.mktemp("bodies") / "punch.stl"
    trimesh.creation.revolve(np.array([[0, 0], *edge, [1, 3], [0, 3]]), sections=128).export(file)
    return file


def test_a_tilted_file_is_the_file_of_a_tilted_body(tmp_path):
    box = trimesh.creation.box((2.0, 1.0, 3.0))
    box.apply_translation([0, 0, 1.5])
    box.export(tmp_path / "upright.stl")
    box.apply_transform(trimesh.transformations.rotation_matrix(np.radians(20), [0, 1, 0]))
    box.export(tmp_path / "tilted.stl")
    places = np.random.default_rng(3).uniform([-1.2, -1.2, -0.2], [1.2, 1.2, 0.4], (200, 3))
    bodies = Indenter(file=tmp_path / "upright.stl", tilt=20), Indenter(file=tmp_path / "tilted.stl")
    one, other = (body.body.gap(places).size for body in bodies)
    np.testing.assert_allclose(one, other, atol=1e-4)


def test_bodies_from_files_press_as_what_they_hold(symmetric_block, ball, punch):
    mesh, law, depth = symmetric_block((6.0, 6.0, 3.0), (3, 3, 2)), NeoHookean(), 0.3
    leaning = {"radius": 1.0, "edge_radius": 0.3, "tilt": 20.0, "angle": 30.0}
    for bodies in (
        (Indenter("sphere", radius=RADIUS), Indenter(file=ball)),
        (Indenter("punch", **leaning), Indenter(file=punch, tilt=20.0, angle=30.0)),
    ):
        one, other = (_force(mesh, law, body, depth) for body in bodies)
        assert other == pytest.approx(one, rel=1.5 * FLATNESS / depth)


def _force(mesh, law, body, depth):
    """N, on a block."""
    images = {mirror: image for mirror, image in node_images(mesh).items() if body.body.keeps(mirror)}
    pad = IndentedPad(mesh, law, IndenterDisplacement(body), tuple(images), images)
    unknowns = np.zeros(pad.unknowns)
    for part in (0.5, 1.0):
        solution, _ = pad.solve(unknowns, np.array([0, 0, -part * depth]))
        unknowns = solution.unknowns
    pressing = pad.model.indentation.contact_state(pad.numbering.split(unknowns)[0], np.array([0, 0, -depth]))
    return -pad.part.copies * pressing.force[2]


def test_the_same_content_is_the_same_body(ball, tmp_path):
    body = Indenter(file=ball)
    assert body == Indenter("file", file=str(ball)) and body.digest and body.shape == "file"
    changed = tmp_path / "body.stl"
    changed.write_bytes(ball.read_bytes())
    body = Indenter(file=changed)
    trimesh.creation.box((1, 1, 1)).export(changed)
    assert body.digest != Indenter(file=changed).digest


def opened(file):
    BALL.submesh([np.arange(len(BALL.faces) - 40)], append=True).export(file)


@pytest.mark.parametrize(
    ("name", "write", "said"),
    [
        ("open.stl", opened, "its surface is open"),
        ("text.stl", lambda file: file.write_text("no body"), "is no STL"),
        ("gone.stl", lambda file: None, "cannot be read"),
        ("body.step", lambda file: file.write_text(""), "ends in one of .stl, .ply, .obj"),
    ],
)
def test_what_is_no_closed_body_is_refused(tmp_path, name, write, said):
    write(tmp_path / name)
    with pytest.raises(InputError, match=f"indenter_file = .*{said}") as caught:
        Indenter(file=tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_has_no_radius_and_a_punch_no_file(ball):
    with pytest.raises(InputError, match="indenter_radius"):
        Indenter(file=ball, radius=2.0)
    with pytest.raises(InputError, match="indenter_file"):
        Indenter("punch", radius=1.0, file=ball)
    with pytest.raises(InputError, match="indenter_file is missing"):
        Indenter("file")
