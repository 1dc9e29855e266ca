"""Surfaces as they come: repaired where that is plain, else refused with the place of the flaw."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.geometry.surfaces.box_tree import overlapping
from mitsuba_taxel.geometry.surfaces.triangles import closest_on_triangles, volume
from mitsuba_taxel.pads.imported import surface_meshing, tetwild
from mitsuba_taxel.pads.imported.surfaces import read_surface
from mitsuba_taxel.pads.imported.triangles.repair import faces_of, repaired
from mitsuba_taxel.pads.pad_file import PadFile, mesh_pad_file


def soup(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def inside_out(box):
    return box[:, ::-1]


def every_third_turned(box):
    box[::3] = box[::3, ::-1]
    return box


def single_precision(box):
    return box.astype(np.float32).astype(float)


def cracked(box):
    return box + np.random.default_rng(1).uniform(-1e-6, 1e-6, box.shape)


def doubled(box):
    return np.concatenate([box, box[5:9], box[3:4, ::-1]])


def missing_triangle(box):
    return np.delete(box, 4, axis=0)


def points_and_needles(box):
    needle = np.array([box[0, 0], box[0, 1], box[0, 1]])
    return np.concatenate([box, needle[None], np.tile(box[2, 1], (1, 3, 1))])


def sliver_between(box):
    # Edge 0 of triangle 0 is cut on its side alone; a triangle without area joins the halves to the neighbour.
    a, b, c = box[0]
    middle = 0.5 * (a + b)
    return np.concatenate([box[1:], [[a, middle, c], [middle, b, c], [a, b, middle]]])


@pytest.mark.parametrize(
    "damage",
    [
        inside_out,
        every_third_turned,
        single_precision,
        cracked,
        doubled,
        missing_triangle,
        points_and_needles,
        sliver_between,
    ],
)
def test_small_flaws_are_mended(box, damage):
    whole = box()
    vertices, triangles = repaired(*soup(damage(whole.copy())))
    assert volume(vertices, triangles) == pytest.approx(44.0, abs=1e-4)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    sliver = damage is sliver_between
    assert len(triangles) == len(whole) + 2 * sliver
    assert len(np.unique(faces_of(vertices, triangles))) == len(whole) + sliver


def test_a_sliver_does_not_keep_a_pad_from_being_meshed(box, write_stl, tmp_path):
    mesh = mesh_pad_file(PadFile(write_stl(tmp_path / "s.stl", sliver_between(box()))), 1.2)
    assert volume(mesh.points, mesh.faces[:, :3]) == pytest.approx(44.0, rel=1e-9)


def without_side(box):
    return box[~np.all(box[:, :, 0] == 2, axis=1)]


def with_fin(box):
    return np.concatenate([box, [[box[0, 0], box[0, 1], (0, 0, 5)]]])


def second_body(box):
    return np.concatenate([box, 0.1 * box + (7, 0, 0)])


def enclosed_hollow(box):
    return np.concatenate([box, (0.1 * box + (0, 0, 2))[:, ::-1]])


def crossing(box):
    box[np.all(box == (-1, -1, 1), axis=-1)] = (-1, -1, 3.5)
    return box


def mobius(box):
    angle = np.linspace(0, 2 * np.pi, 13)
    half = np.stack([np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)], axis=1)
    ring = 4 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    low, high = ring - half, ring + half
    low[-1], high[-1] = high[0], low[0]
    return np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    )


@pytest.mark.parametrize(
    ("damage", "what", "where"),
    [
        (without_side, "open: a hole", (2, 0, 1.5)),
        (with_fin, "3 triangles meet", None),
        (second_body, "2 separate surfaces", (7, 0, 0.15)),
        (enclosed_hollow, "2 separate surfaces", (0, 0, 2.15)),
        (crossing, "intersects itself", None),
        (mobius, "no inside", None),
    ],
)
def test_other_flaws_are_refused_with_their_place(box, damage, what, where):
    with pytest.raises(GeometryError, match=rf"{what}.*\(.*, .*, .*\) mm") as caught:
        repaired(*soup(damage(box())))
    if where:
        place = [float(x) for x in str(caught.value).split("(")[1].split(")")[0].split(",")]
        np.testing.assert_allclose(place, where, atol=1e-3)


def test_a_crossing_is_found_where_it_is(box):
    with pytest.raises(GeometryError) as caught:
        repaired(*soup(crossing(box())))
    x, y, z = (float(x) for x in str(caught.value).split("(")[1].split(")")[0].split(","))
    assert z == pytest.approx(3, abs=1e-3) and max(abs(x), abs(y)) < 2


def test_boxes_overlap_as_by_trying_all_pairs():
    rng = np.random.default_rng(3)
    low = rng.uniform(0, 1, (70, 3)) * (1, 1, 0.02)
    high = low + rng.uniform(0, 1, (70, 1)) ** 4 * (1, 0.5, 0)
    for count in (1, 2, 33, 70):
        found = set(zip(*map(np.ndarray.tolist, overlapping(low[:count], high[:count], low, high)), strict=True))
        meet = np.all((low[:count, None] <= high) & (low <= high[:count, None]), axis=-1)
        assert found == set(zip(*map(np.ndarray.tolist, np.nonzero(meet)), strict=True))


def test_the_closest_point_of_a_triangle_is_no_further_than_any_of_it():
    rng = np.random.default_rng(4)
    corners, points = rng.normal(size=(40, 3, 3)), 2 * rng.normal(size=(40, 3))
    closest = closest_on_triangles(points, corners)
    weights = rng.dirichlet((0.5, 0.5, 0.5), 4000)
    distance = np.linalg.norm(np.einsum("sk,nkj->nsj", weights, corners) - points[:, None], axis=-1).min(axis=1)
    found = np.linalg.norm(closest - points, axis=1)
    assert np.all(found <= distance + 1e-12)
    np.testing.assert_allclose(found, distance, atol=0.05)


@pytest.mark.parametrize("kind", ["stl_ascii", "ply", "obj"])
def test_all_formats_hold_the_same_surface(box, kind):
    import trimesh

    expected = repaired(*soup(box()))
    buffer = io.BytesIO()
    content = trimesh.Trimesh(*soup(box()), process=False).export(buffer, file_type=kind)
    content = content.encode() if isinstance(content, str) else buffer.getvalue() or content
    vertices, triangles = repaired(*read_surface(content, "." + kind[:3]))
    np.testing.assert_array_equal(vertices, expected[0])
    assert {frozenset(row) for row in triangles.tolist()} == {frozenset(row) for row in expected[1].tolist()}


def stl(corners: np.ndarray, count: int | None = None) -> bytes:
    rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = corners
    return bytes(80) + (len(rows) if count is None else count).to_bytes(4, "little") + rows.tobytes()


def not_a_number(box):
    box[3, 1, 2] = np.nan
    return stl(box)


PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
PLY += b"property float z\nelement face 4000000000\nproperty list uchar int vertex_indices\nend_header\n" + bytes(99)


@pytest.mark.parametrize(
    ("suffix", "content", "what"),
    [
        (
            ".stl",
            lambda box: stl(0.001 * box / 4),
            r"0.001 mm \(if the file is in m, file_scale = 1000 makes it 1 mm\)",
        ),
        (".stl", lambda box: stl(1000 * box), "if the file is in um, file_scale = 0.001 makes it 4 mm"),
        (".stl", lambda box: stl(box, 1_000_000_000), "announces 1000000000 triangles"),
        (".stl", lambda box: stl(box)[:-7], "cut short"),
        (".stl", lambda box: stl(box)[:70], "less than a header"),
        (".stl", lambda box: b"", "0 bytes"),
        (".stl", lambda box: stl(box[:0]), "no triangles"),
        (".stl", not_a_number, "not finite"),
        (".stl", lambda box: b"solid\n" + b"this is no geometry, facet or not\n" * 99, "STL"),
        (".stl", lambda box: b"%PDF-1.7 " + bytes(range(256)) * 9, "no STL"),
        (".ply", lambda box: PLY, "PLY"),
        (".ply", lambda box: b"garbage", "PLY"),
        (".obj", lambda box: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "OBJ"),
        (".obj", lambda box: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2000000000\n", "OBJ"),
        (".obj", lambda box: b"\xff\xfe\x00garbage", "OBJ"),
    ],
)
def test_what_is_no_surface_in_mm_is_refused(box, suffix, content, what):
    with pytest.raises(GeometryError, match=what):
        read_surface(content(box()), suffix)


def test_too_many_triangles_are_refused(box, monkeypatch):
    monkeypatch.setattr("mitsuba_taxel.pads.imported.surfaces.MOST_TRIANGLES", 20)
    with pytest.raises(GeometryError, match="28 triangles; at most 20"):
        read_surface(stl(box()), ".stl")


def _no_mesher(*_):
    raise ComputationError("as far as this test goes.")


@settings(max_examples=150)
@given(data=st.data())
def test_whatever_the_bytes_the_answer_is_one_line(data, box, tmp_path, monkeypatch):
    monkeypatch.setattr(surface_meshing, "_meshed", _no_mesher)
    monkeypatch.setattr(tetwild, "run_isolated", _no_mesher)
    content = bytearray(stl(box()))
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(80, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.sampled_from([0, 0, 0, 50, 100, 7]))
    path = tmp_path / "damaged.stl"
    path.write_bytes(bytes(content[: len(content) - cut]))
    if cut % 50 == 0 and data.draw(st.booleans()):
        content[80:84] = (28 - cut // 50).to_bytes(4, "little")
        path.write_bytes(bytes(content[: len(content) - cut]))
    with pytest.raises((InputError, ComputationError)) as caught:
        mesh_pad_file(PadFile(path), 1.25)
    assert "\n" not in str(caught.value)


def test_a_texture_that_a_file_names_is_neither_opened_nor_spoken_of(tmp_path, caplog):
    head = "ply\nformat ascii 1.0\ncomment TextureFile x.png\nelement vertex 0\nproperty float x\nend_header\n"
    (tmp_path / "pad.ply").write_text(head)
    with pytest.raises(GeometryError, match="it holds no triangles of the format PLY"):
        read_surface((tmp_path / "pad.ply").read_bytes(), ".ply")
    assert not caplog.records
