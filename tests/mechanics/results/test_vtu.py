"""VTU files: read back by meshio and by the rules of VTK; whole or not there."""

from __future__ import annotations

import base64
import os
import zlib
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.results.fields import nodal_fields
from mitsuba_taxel.mechanics.results.vtu import write_vtu

COMPONENTS = {
    "displacement [mm]": 3,
    "mean stress [MPa]": 1,
    "von Mises stress [MPa]": 1,
    "Cauchy stress [MPa]": 6,
    "volume ratio J": 1,
    "principal stretches": 3,
}
QUADRATIC_TETRA = 24
"""VTK's number of the cell type, whose nodes 4 to 9 lie on the edges below (VTK file formats, figure 3)."""
VTK_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


@pytest.fixture
def deformed(block):
    """Mesh, displacement and pressure; their arrays fill several of the file's compressed blocks."""
    mesh = block(size=(1.0, 2.0, 0.5), cells=(4, 6, 3), distortion=0.1, curvature=0.03)
    displacement = 0.02 * np.sin(mesh.points @ np.array([[1, 0.3, 0.2], [0.1, 1, 0], [0, 0.2, 0.7]]))
    return mesh, displacement, np.linspace(-0.5, 0.3, mesh.corner_count)


def decoded(array):
    """Values of a DataArray: base64 of [blocks, their size, that of the last, compressed sizes...], then the blocks."""
    kind = {"Float64": np.float64, "Int64": np.int64}[array.get("type")]
    text = array.text.strip()
    count = int(np.frombuffer(base64.b64decode(text[:8])[:4], np.uint32)[0])
    header_text = -(-4 * (3 + count) // 3) * 4
    sizes = np.frombuffer(base64.b64decode(text[:header_text]), np.uint32)[3 : 3 + count]
    body, content = base64.b64decode(text[header_text:]), b""
    for size in sizes:
        content += zlib.decompress(body[:size])
        body = body[size:]
    assert not body
    values = np.frombuffer(content, kind)
    return values.reshape(-1, int(array.get("NumberOfComponents", 1))).squeeze()


def test_all_fields_are_read_back(tmp_path, deformed):
    mesh, displacement, pressure = deformed
    write_vtu(tmp_path / "pad.vtu", mesh, displacement, pressure, NeoHookean())
    read = meshio.read(tmp_path / "pad.vtu")
    fields = nodal_fields(mesh, displacement, pressure, NeoHookean())
    np.testing.assert_array_equal(read.points, mesh.points)
    assert [block.type for block in read.cells] == ["tetra10"]
    np.testing.assert_array_equal(read.cells[0].data, mesh.tets)
    assert {name: values[0].size for name, values in read.point_data.items()} == COMPONENTS
    np.testing.assert_array_equal(read.point_data["displacement [mm]"], displacement)
    np.testing.assert_array_equal(read.point_data["mean stress [MPa]"], fields.pressure)
    np.testing.assert_array_equal(read.point_data["von Mises stress [MPa]"], fields.von_mises_stress)
    np.testing.assert_array_equal(read.point_data["volume ratio J"], fields.volume_ratio)
    np.testing.assert_array_equal(read.point_data["principal stretches"], fields.principal_stretches)
    for column, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]):
        stress = read.point_data["Cauchy stress [MPa]"][:, column]
        np.testing.assert_array_equal(stress, fields.cauchy_stress[:, i, j])
    assert not read.cell_data
    pressed = np.arange(len(mesh.points), dtype=float)
    write_vtu(tmp_path / "pad.vtu", mesh, displacement, pressure, NeoHookean(), contact_pressure=pressed)
    read = meshio.read(tmp_path / "pad.vtu")
    np.testing.assert_array_equal(read.point_data["contact pressure [MPa]"], pressed)


def test_the_xml_is_what_vtk_s_reader_expects(tmp_path, deformed):
    mesh, displacement, pressure = deformed
    write_vtu(tmp_path / "pad.vtu", mesh, displacement, pressure, NeoHookean())
    root = ElementTree.parse(tmp_path / "pad.vtu").getroot()
    assert (root.tag, root.get("type"), root.get("compressor")) == (
        "VTKFile",
        "UnstructuredGrid",
        "vtkZLibDataCompressor",
    )
    assert root.get("byte_order") in ("LittleEndian", "BigEndian")
    (grid,) = root
    (piece,) = grid
    assert (grid.tag, piece.tag) == ("UnstructuredGrid", "Piece")
    assert piece.attrib == {"NumberOfPoints": str(len(mesh.points)), "NumberOfCells": str(len(mesh.tets))}
    assert {part.tag for part in piece} == {"Points", "Cells", "PointData"}
    cells = {array.get("Name"): decoded(array) for array in piece.find("Cells")}
    assert set(cells) == {"connectivity", "offsets", "types"}
    np.testing.assert_array_equal(cells["types"], np.full(len(mesh.tets), QUADRATIC_TETRA))
    np.testing.assert_array_equal(cells["offsets"], 10 * np.arange(1, len(mesh.tets) + 1))
    np.testing.assert_array_equal(cells["connectivity"], mesh.tets.ravel())
    (points,) = piece.find("Points")
    assert points.get("NumberOfComponents") == "3"
    np.testing.assert_array_equal(decoded(points), mesh.points)
    data = {array.get("Name"): array for array in piece.find("PointData")}
    assert {name: int(array.get("NumberOfComponents", 1)) for name, array in data.items()} == COMPONENTS
    assert all(array.get("format") == "binary" for array in piece.iter("DataArray"))
    np.testing.assert_array_equal(decoded(data["displacement [mm]"]), displacement)


def test_the_nodes_of_elements_are_in_vtk_s_order(tmp_path, block):
    mesh = block(size=(1.0, 2.0, 0.5), cells=(2, 2, 2), distortion=0.2)
    at_rest = np.zeros_like(mesh.points), np.zeros(mesh.corner_count)
    write_vtu(tmp_path / "pad.vtu", mesh, *at_rest, NeoHookean())
    read = meshio.read(tmp_path / "pad.vtu")
    nodes = read.points[read.cells[0].data]
    for node, ends in enumerate(VTK_EDGES, start=4):
        np.testing.assert_allclose(nodes[:, node], nodes[:, ends].mean(axis=1), atol=1e-14)
    volume = np.linalg.det(nodes[:, 1:4] - nodes[:, :1]) / 6  # positive: node 3 lies above the right-handed 0, 1, 2
    assert volume.min() > 0
    assert volume.sum() == pytest.approx(1.0, rel=1e-12)


def test_the_same_state_gives_the_same_bytes(tmp_path, deformed):
    for name in ("one.vtu", "two.VTU"):
        write_vtu(str(tmp_path / name), *deformed, NeoHookean())
    assert (tmp_path / "one.vtu").read_bytes() == (tmp_path / "two.VTU").read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["one.vtu", "two.VTU"]
    umask = os.umask(0)
    os.umask(umask)
    assert (tmp_path / "one.vtu").stat().st_mode & 0o777 == 0o666 & ~umask


class Failing(NeoHookean):
    def stress(self, gradient, determinant, inverse_transpose):
        raise RuntimeError("no stress")


def full_disk(*_):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("before", [None, b"an older file"])
@pytest.mark.parametrize("failure", ["law", "write", "sync", "interrupt"])
def test_nothing_is_left_behind_on_failure(tmp_path, monkeypatch, deformed, before, failure):
    file = tmp_path / "pad.vtu"
    if before:
        file.write_bytes(before)
    material, expected = NeoHookean(), InputError

    def interrupted(name, grid):
        name.write_text("half")
        raise KeyboardInterrupt

    if failure == "law":
        material, expected = Failing(), RuntimeError
    elif failure == "write":
        monkeypatch.setattr(meshio.vtu, "write", full_disk)
    elif failure == "sync":
        monkeypatch.setattr(os, "fsync", full_disk)
    else:
        monkeypatch.setattr(meshio.vtu, "write", interrupted)
        expected = KeyboardInterrupt
    with pytest.raises(expected):
        write_vtu(file, *deformed, material)
    assert os.listdir(tmp_path) == (["pad.vtu"] if before else [])
    assert not before or file.read_bytes() == before


@pytest.mark.parametrize("place", ["missing/pad.vtu", "a_file/pad.vtu", "a_folder.vtu"])
def test_places_that_cannot_be_written_are_refused(tmp_path, deformed, place):
    (tmp_path / "a_file").write_text("in the way")
    (tmp_path / "a_folder.vtu").mkdir()
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(InputError, match=r"^output .*\.vtu cannot be written: [A-Z].*\.$") as caught:
        write_vtu(tmp_path / place, *deformed, NeoHookean())
    assert "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path)) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused(tmp_path, deformed):
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="cannot be written: Permission denied"):
        write_vtu(tmp_path / "pad.vtu", *deformed, NeoHookean())


@pytest.mark.parametrize("name", ["pad.vtk", "pad", "pad.vtu.txt"])
def test_another_ending_is_refused(tmp_path, deformed, name):
    with pytest.raises(InputError, match=f"{name} must end in .vtu"):
        write_vtu(tmp_path / name, *deformed, NeoHookean())
    assert not os.listdir(tmp_path)
