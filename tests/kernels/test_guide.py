"""Which triangles a guide draws, and in which order: that of the undeformed pad."""

from __future__ import annotations

import numpy as np
import pytest
from plain_meshes import domed_cell, mesh_of
from plate_scenes import plate

from mitsuba_taxel import Pad, PadSensor, Scene, Wall, measure
from mitsuba_taxel.kernels.paths import guide
from mitsuba_taxel.kernels.paths.guide import guide_for
from mitsuba_taxel.kernels.surfaces.mesh_adapter import move_vertices, places_of
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.taxels import taxels_of

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


def domed(force, roof="isotropic", cell="hemispheric", reflectance=0.9):
    sensor = PadSensor(pad=Pad(cell, rows=1, columns=1), force=(0.0, 0.0, force), roof=Wall(roof, reflectance))
    return sensor.scene().with_mesh_size(2.0)


def pad_of(live):
    (pad,) = (shape for shape in live.shapes() if hasattr(shape, "state"))
    return pad


def guide_of(scene):
    live = scene.load()
    return guide_for(live, taxels_of(live)[0])


@pytest.mark.parametrize("roof", ["isotropic", "lambertian"])
def test_load_steps_share_the_order_of_their_triangles(llvm_mono, roof):
    """The same leaves under any load; their shares are those of the areas there."""
    rest, loaded = guide_of(domed(0.0, roof)), guide_of(domed(-3.0, roof))
    assert np.array_equal(np.array(rest.leaves), np.array(loaded.leaves))
    assert not np.array_equal(np.array(rest.splits), np.array(loaded.splits))
    assert loaded.area[0] != rest.area[0]


@pytest.mark.parametrize("finish", [{}, {"finish": "random"}])
def test_members_have_the_area_of_the_surface_they_lie_on(llvm_mono, finish):
    """An independent sum over the deformed mesh, of the roof's triangles of each cell."""
    description = {"type": "deformable_pad", "cell": "hemispheric", "rows": 1, "columns": 2, "force": [0, 0, -3]}
    description |= {"mesh_size": 2.0, "walls": {"type": "region", "roof": {"type": "wall"}}}
    if finish:
        description |= finish | {"rms_height": 0.02, "correlation_length": 0.4}
    reflector = {"type": "photo_reflector", "rows": 1, "columns": 2, "led": {"type": "annular_led"}}
    reflector |= {"detector": {"type": "phototransistor"}}
    live = Scene({"type": "scene", "pad": description, "packages": reflector}).load()
    pad = pad_of(live)
    parameters = llvm_mono.traverse(pad)
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    a, b, c = vertices[np.array(parameters["faces"]).reshape(-1, 3)].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    region, cell = (np.array(parameters[f"face_{name}"]).round() for name in ("region", "cell"))
    found = guide_for(live, taxels_of(live)[0])
    for taxel in range(2):
        assert found.area[taxel] == pytest.approx(area[(region == 1) & (cell == taxel + 1)].sum(), rel=1e-5)


@pytest.mark.parametrize("roof", ["isotropic", "lambertian"])
def test_a_moved_pad_reads_as_one_loaded_so(llvm_mono, roof):
    ready, other = prepare(domed(-1.0, roof)), prepare(domed(-3.0, roof))
    first = measure(ready, points=64, seed=3, mechanics_error=False)
    move_vertices(pad_of(ready.scene), places_of(pad_of(other.scene)))
    ready.scene.parameters_changed([])
    moved, loaded = (measure(scene, points=64, seed=3, mechanics_error=False) for scene in (ready, other))
    assert np.array_equal(moved.replicates, loaded.replicates)
    assert not np.array_equal(moved.replicates, first.replicates)


def test_what_is_kept_changes_no_reading(llvm_mono):
    """The order of the triangles comes from the pad, whether other scenes have needed it before or not."""
    kept = [measure(domed(force), points=64, mechanics_error=False).replicates for force in (-1.0, -2.0)]
    for force, replicates in zip((-2.0, -1.0), reversed(kept), strict=True):
        guide._members.cache_clear()
        assert np.array_equal(measure(domed(force), points=64, mechanics_error=False).replicates, replicates)


@pytest.mark.parametrize("cell, guided", [("hemispheric", True), ("spherical", True), ("parallelepiped", False)])
def test_flat_roofs_need_no_guide(llvm_mono, cell, guided):
    assert (guide_of(domed(-1.0, cell=cell)) is not None) == guided


def test_light_to_walls_that_a_guide_misses_counts_against_it(llvm_mono, monkeypatch):
    """A guide along the sides of a cylinder draws few rays to its bright roof: weights without a bound, and a
    larger error."""
    walls = {"roof": Wall("isotropic", 1.0), "side": Wall("lambertian", 0.9)}
    ready = prepare(PadSensor(pad=Pad("cylindrical", rows=1, columns=1), **walls).scene().with_mesh_size(2.0))
    assert guide_for(ready.scene, taxels_of(ready.scene)[0]) is None
    plain = measure(ready, points=1 << 10, mechanics_error=False)
    taxels_of(ready.scene)[0].sensor.guide = None
    monkeypatch.setattr(guide.Guide, "misses", lambda self, si, active: active & False)
    guided = measure(ready, points=1 << 10, mechanics_error=False)
    assert guided.relative_error > 2 * plain.relative_error


def test_no_light_is_lost_between_fine_triangles(llvm_mono, monkeypatch):
    """Rays that the guide draws to points close by, at grazing angles, arrive; without it the walls draw all rays."""
    scene = domed(-3.0, reflectance=0.3)
    scene.source["pad"]["subdivision"] = 64
    ready = prepare(scene)
    guided = measure(ready, points=512, mechanics_error=False)
    monkeypatch.setattr("mitsuba_taxel.plugins.integrators.taxel_tracer.guide_for", lambda scene, pair: None)
    plain = measure(ready, points=512, mechanics_error=False)
    error = np.hypot(guided.standard_error, plain.standard_error)
    assert error < 1e-3 * plain.power
    assert abs(guided.power - plain.power) < 3 * error


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
