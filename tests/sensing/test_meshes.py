"""Meshes of a million triangles, and of some without area."""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import plate_power
from plate_scenes import BODY_TOP, WHITE, plate

from mitsuba_taxel import Scene, measure


def test_a_plate_of_a_million_triangles_reads_as_a_rectangle(llvm_mono, agree, tmp_path):
    mi = llvm_mono
    grid = plate_mesh(mi, cells=708)
    assert len(mi.traverse(grid)["faces"]) // 3 == 1_002_528
    grid.write_ply(str(tmp_path / "plate.ply"))
    ply = {"type": "ply", "filename": str(tmp_path / "plate.ply"), "face_normals": True, "bsdf": WHITE}
    coarse, fine = (
        measure(plate(z=0.3, scattering="lambertian", plate=shape), points=1 << 13, seed=6) for shape in (None, ply)
    )
    assert fine.power == pytest.approx(coarse.power, rel=1e-4)
    agree(fine.power, fine.standard_error, plate_power(0.3, "uniform_solid_angle", "lambertian"))


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic", "mirror"])
def test_degenerate_triangles_change_nothing(llvm_mono, scattering):
    """Points and lines for triangles, in the plate and before it."""
    mi = llvm_mono
    bsdf = {"type": "wall", "scattering": scattering}
    clean, dirty = (
        measure(
            plate(z=0.3, scattering=scattering, plate=plate_mesh(mi, cells=4, degenerate=degenerate, bsdf=bsdf)),
            points=1 << 11,
            seed=7,
        )
        for degenerate in (False, True)
    )
    assert clean.power[0] > 0
    assert np.allclose(dirty.replicates, clean.replicates, rtol=1e-5)


def test_a_guide_takes_degenerate_triangles(llvm_mono, agree):
    """A dome over the photo-reflector, with the attributes of a pad and thousands of triangles without area."""
    readings, guides = [], []
    for degenerate in (False, True):
        live = domed_cell(llvm_mono, degenerate).load()
        readings.append(measure(live, points=1 << 12, seed=8 + degenerate))
        guides.append(live.sensors()[0].guide[1])
    clean, dirty = readings
    assert guides[1] is not None and guides[1].area[0] == pytest.approx(guides[0].area[0], rel=1e-6)
    assert np.all(np.isfinite(dirty.replicates)) and dirty.relative_error < 5e-3
    agree(dirty.power, dirty.standard_error, clean.power, clean.standard_error)


def test_a_cell_without_area_has_no_guide(llvm_mono):
    """A mesh with the attributes of a pad, all of whose triangles are points: it reads what is there without it."""
    mi = llvm_mono
    points = np.repeat(np.array([[0.0, 0, 1], [0.2, 0, 1], [0, 0.2, 1]]), 3, axis=0)
    mesh = mesh_of(mi, points, np.arange(9).reshape(3, 3), region=1, cell=1)
    scene = plate(z=0.7, scattering="lambertian").source
    without = measure(Scene(scene), points=512)
    reading = measure(Scene({**scene, "mesh": mesh}), points=512)
    assert reading.power == pytest.approx(without.power, rel=1e-5)


def mesh_of(mi, vertices, triangles, bsdf=WHITE, **attributes):
    """An ``mi.Mesh`` with flat normals; ``attributes`` are numbers of its faces."""
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf)
    props["face_normals"] = True
    mesh = mi.Mesh("mesh", len(vertices), len(triangles), props=props)
    parameters = mi.traverse(mesh)
    parameters["faces"] = np.asarray(triangles, dtype=np.uint32).ravel()
    parameters["vertex_positions"] = np.asarray(vertices, dtype=np.float32).ravel()
    parameters.update()
    for name, values in attributes.items():
        values = np.broadcast_to(np.asarray(values, dtype=np.float32), len(triangles))
        mesh.add_attribute(f"face_{name}", 1, np.ascontiguousarray(values))
    return mesh


def grid_of(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of [-1, 1]² at z = 0, which face +z."""
    line = np.linspace(-1, 1, cells + 1)
    x, y = np.meshgrid(line, line)
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), triangles


def with_degenerate(vertices: np.ndarray, triangles: np.ndarray, before: float):
    """Also triangles of one vertex, of two, of three on a line, and the same moved by ``before`` along z."""
    first, second, third = triangles.T
    count = len(vertices)
    middle = 0.5 * (vertices[first] + vertices[second])
    third_on_line = count + np.arange(len(triangles))
    flat = np.concatenate(
        [
            np.stack([first, first, first], axis=1),
            np.stack([first, second, second], axis=1),
            np.stack([first, third, first], axis=1),
            np.stack([first, second, third_on_line], axis=1),
        ]
    )
    vertices = np.concatenate([vertices, middle])
    return (
        np.concatenate([vertices, vertices + [0, 0, before]]),
        np.concatenate([triangles, flat, flat + len(vertices)]),
    )


def plate_mesh(mi, cells: int, degenerate: bool = False, bsdf=WHITE):
    """A plate 4 mm wide, 0.3 mm above the LED's plane and facing down, in 2 cells² triangles."""
    vertices, triangles = grid_of(cells)
    if degenerate:
        vertices, triangles = with_degenerate(vertices, triangles, before=0.05)
    return mesh_of(mi, vertices * [2, -2, -1] + [0, 0, BODY_TOP + 0.3], triangles, bsdf)


def domed_cell(mi, degenerate: bool) -> Scene:
    """A photo-reflector under half a sphere of radius 1.3 mm, open below, that is a pad's mesh to the guide."""
    square, triangles = grid_of(16)
    polar = 0.5 * np.pi * np.abs(square[:, :2]).max(axis=1)
    azimuth = np.arctan2(square[:, 1], square[:, 0])
    dome = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    if degenerate:
        dome, triangles = with_degenerate(dome, triangles, before=-0.1)
    cover = {"type": "region", "roof": {"type": "wall", "reflectance": 0.9}}
    mesh = mesh_of(mi, 1.3 * dome, triangles[:, ::-1], cover, region=1, cell=1)
    return Scene({**plate().source, "plate": mesh})
