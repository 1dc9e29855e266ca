"""Contact of pads with packages and the board is found exactly where closed forms say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from first_contact import box, first_contact

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad, mesh_pad

# ---- the pad against the board and packages --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def single():
    """A cell with a flat roof: the pad and its mesh."""
    pad = Pad("parallelepiped", rows=1, columns=1)
    return pad, mesh_pad(pad, 1.2)


def roof_down(pad, mesh, x0, y0):
    """A roof sunk as a paraboloid, by 1 at its lowest point (x0, y0) between nodes; the faces of the roof are exact."""
    x, y, z = mesh.points.T
    shape = 1 - ((x - x0) ** 2 + (y - y0) ** 2) / 16
    return np.stack([0 * x, 0 * x, -shape * np.minimum(z / pad.top_of_cell, 1)], axis=1)


@pytest.mark.parametrize(
    ("low", "high", "nearest"),
    [
        ((-0.53, -0.73, 0), (0.53, 0.73, 0.5), (0.13, 0.21)),
        ((0.4, 0.3, 0), (0.9, 0.8, 0.7), (0.4, 0.3)),
        ((-0.9, -0.1, 0), (-0.3, 0.9, 0.4), (-0.3, 0.21)),
    ],
)
def test_a_roof_comes_down_on_a_box(single, low, high, nearest):
    """On its face, a corner or an edge, whichever is under the lowest point over the box."""
    pad, mesh = single
    x0, y0 = 0.13, 0.21
    sink = roof_down(pad, mesh, x0, y0)
    depth = 1 - ((nearest[0] - x0) ** 2 + (nearest[1] - y0) ** 2) / 16
    amplitude, contact = first_contact(ContactTest(mesh, box(low, high)), lambda a: a * sink, 0.7, 1.4)
    assert amplitude == pytest.approx((pad.top_of_cell - high[2]) / depth, rel=2e-8)
    assert contact.what == "a package"
    assert contact.place == pytest.approx((*nearest, high[2]), abs=1e-3)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_a_roof_comes_down_on_the_board(single, scale):
    pad, mesh = single
    sink = scale * roof_down(pad, mesh, 0.13, 0.21)
    test = ContactTest(replace(mesh, points=scale * mesh.points))
    amplitude, contact = first_contact(test, lambda a: a * sink, 1.4, 1.7)
    assert amplitude == pytest.approx(pad.top_of_cell, rel=2e-8)
    assert contact.what == "the board"
    assert contact.place == pytest.approx((scale * 0.13, scale * 0.21, 0), abs=scale * 1e-3)


@pytest.mark.parametrize("layers", [5, 6, 8])
def test_an_outer_wall_bulges_below_the_board(block, layers):
    """z - a z (1 - z / H) is below 0 next to the rim as soon as a > 1, and at z = 0.02 H from a = 1 / 0.98 on.

    The strip below does not count, where this is the answer to a singular stress, wherever the elements end.
    """
    mesh, height = block((2.0, 2.0, 1.5), (2, 2, layers)), 1.5
    z = mesh.points[:, 2:]
    sunk = z * (1 - z / height) * np.column_stack([mesh.points[:, :2] - 1, np.full(len(z), -1.0)])
    test = ContactTest(mesh)
    assert test.find(0.999 / 0.98 * sunk) is None
    assert test.find(1.001 / 0.98 * sunk).what == "the board"


@pytest.mark.parametrize("cell", CELL_SHAPES)
def test_the_tip_of_a_needle_in_a_face(cell):
    """A needle from the board ends just below or just above a point of a roof that is no node."""
    mesh = mesh_pad(Pad(cell, rows=1, columns=1), 1.2)
    roof = np.flatnonzero(mesh.face_region == REGIONS["roof"])
    for face in roof[:: len(roof) // 3]:
        weights = shape_functions(np.array([[0.23, 0.36, 0.41]]))[0]
        tip = weights @ mesh.points[mesh.faces[face]]
        foot = np.array([[0.02, 0, 0], [-0.01, 0.02, 0], [-0.01, -0.02, 0]]) + 0.5 * tip * (1, 1, 0) + (0, 0, 0.1)
        for beyond in (-1e-6, 1e-6):
            end = tip + beyond * (tip - foot.mean(axis=0)) / np.linalg.norm(tip - foot.mean(axis=0))
            needle = np.array([foot, *([foot[k], foot[k - 1], end] for k in range(3))])
            contact = ContactTest(mesh, needle).find(np.zeros_like(mesh.points))
            assert (contact is not None) == (beyond > 0)
            if contact:
                assert contact.what == "a package"
                assert contact.place == pytest.approx(tuple(tip), abs=2e-6)


@pytest.mark.parametrize("cell", CELL_SHAPES)
def test_a_body_within_the_silicone_and_the_pad_within_a_body(cell):
    pad = Pad(cell, rows=2, columns=1)
    mesh = mesh_pad(pad, 1.2)
    rest = np.zeros_like(mesh.points)
    free = [box((x - 0.5, y - 0.7, 0), (x + 0.5, y + 0.7, 0.5)) for x, y in pad.cell_centres]
    assert ContactTest(mesh, np.concatenate(free)).find(rest) is None
    beside = box((9, 9, 1), (10, 10, 2))
    assert ContactTest(mesh, beside).find(rest) is None
    for low in ((0, 0, 3), (-2, -0.1, 1), (0.3, 1, 4)):
        high = np.array(low) + 0.2
        hidden = np.concatenate([*free, box(low, high), beside])
        contact = ContactTest(mesh, hidden).find(rest)
        assert contact.what == "a package"
        assert np.all((contact.place >= np.array(low)) & (contact.place <= high))
    assert ContactTest(mesh, box((-50, -50, -50), (50, 50, 50))).find(rest).what == "a package"


def test_packages_may_be_looked_at_alone(single):
    """A roof that comes down on the board, and on a package if there is one."""
    pad, mesh = single
    sink = roof_down(pad, mesh, 0.13, 0.21)
    deep = (pad.top_of_cell + 0.1) * sink
    low, high = (0.3, 0.3, 0.0), (0.6, 0.6, 0.5)
    test = ContactTest(mesh, box(low, high))
    assert test.find(deep).what == "the board" and test.find_package(deep).what == "a package"
    assert test.at_rest is None and test.find_package(0.2 * sink) is None
    assert ContactTest(mesh).find_package(deep) is None
    aside = ContactTest(mesh, box((9, 9, 0), (10, 10, 1)))
    assert aside.find(deep).what == "the board" and aside.find_package(deep) is None


def test_triangles_without_area_do_no_harm(single):
    """Points, needles and doubled sides in an obstacle count where they are, and nowhere else."""
    _, mesh = single
    rest = np.zeros_like(mesh.points)
    package = box((-0.5, -0.5, 0), (0.5, 0.5, 0.5))
    line = np.array([[[-0.5, -0.5, 0.5], [0, 0, 0.5], [0.5, 0.5, 0.5]]])
    point = np.full((1, 3, 3), 0.5)
    harmless = np.concatenate([package, line, point])
    assert ContactTest(mesh, harmless).find(rest) is None
    through = np.array([[[0, 0, 0.5], [0, 0, 1.0], [0, 0, 2.0]]])
    assert ContactTest(mesh, np.concatenate([harmless, through])).find(rest).what == "a package"
    crushed = rest.copy()
    crushed[mesh.points[:, 2] > 1, 2] = 1 - mesh.points[mesh.points[:, 2] > 1, 2]
    assert ContactTest(mesh, harmless).find(crushed) is not None


@pytest.mark.parametrize("obstacles", [np.zeros((3, 3)), np.zeros((0, 3, 3)), np.full((1, 3, 3), np.nan)])
def test_what_is_no_triangle(single, obstacles):
    with pytest.raises(InputError, match=r"^obstacles = .* is not allowed: .* needed\.$"):
        ContactTest(single[1], obstacles)
