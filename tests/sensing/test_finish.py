"""Readings of pads with rough walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import AnnularLed, Pad, PadSensor, PhotoReflector, Scene, Wall, measure
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import Grooves, LayerSteps, RandomRoughness, SeparateFinish
from mitsuba_taxel.sensing.reading.mechanics_error import moved

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


def sensor(cell, finish, fz=0.0):
    return PadSensor(
        pad=Pad(cell, rows=1, columns=1),
        photo_reflector=PhotoReflector(led=AnnularLed(law="lambertian")),
        force=(0, 0, fz),
        roof=Wall("lambertian", 0.5),  # more light would go to and fro: more noise, and nothing else to see
        side=Wall("lambertian", 0.1),
        finish=finish,
    )


def read(cell, finish, fz=0.0, subdivision=12, points=1 << 11, mesh_size=None):
    scene = sensor(cell, finish, fz).scene().with_mesh_size(mesh_size)
    scene.source["pad"]["subdivision"] = subdivision
    return measure(scene, points=points, seed=3, mechanics_error=False)


def read_on_chords(cell, finish, fz, subdivision, points, mesh_size):
    """With the vertices of the triangles on the smooth walls, so that these are chords of them."""
    scene = sensor(cell, finish, fz).scene().with_mesh_size(mesh_size)
    scene.source["pad"]["subdivision"] = subdivision
    live = scene.load()
    pads = [shape for shape in live.shapes() if hasattr(shape, "chords")]
    with moved(live, pads, [pad.chords() for pad in pads]):
        return measure(live, points=points, seed=3, mechanics_error=False)


@pytest.mark.parametrize(
    ("finish", "points"),
    [
        (LayerSteps(0.25, refinement=0.1), 1 << 12),
        (Grooves(0.5, 0.1, refinement=0.1), 1 << 11),
        (RandomRoughness(0.05, 1.5, refinement=2), 1 << 11),
    ],
)
def test_the_reading_converges_as_the_surface_is_refined(llvm_mono, finish, points):
    """The error falls with the square of the triangles' size, by four each time the size is halved: that of triangles
    which are chords of the smooth walls starts above 0.6 %, on elements of the pad's default size."""
    how = {"fz": -2, "points": points, "mesh_size": 1.25}
    finest = read("hemispheric", finish, subdivision=24, **how)
    chords = read_on_chords("hemispheric", finish, subdivision=2, **how)
    change = (chords.replicates - finest.replicates).ravel()
    assert change.mean() > 0.006 * finest.power[0] + 4 * change.std(ddof=1) / np.sqrt(len(change))
    for subdivision, bound in ((2, 0.02), (4, 0.006), (12, 0.002)):
        coarse = read("hemispheric", finish, subdivision=subdivision, **how)
        change = (coarse.replicates - finest.replicates).ravel() / finest.power[0]
        error = change.std(ddof=1) / np.sqrt(len(change))
        assert error < 1.2e-3
        assert abs(change.mean()) < bound + 4 * error


@pytest.mark.parametrize(
    ("cell", "finish"),
    [
        ("hemispheric", LayerSteps(0.2)),
        ("parallelepiped", Grooves(0.3, 0.02)),
        ("hemispheric", RandomRoughness(0.02, 0.3)),
    ],
)
def test_the_default_refinement_is_fine_enough(llvm_mono, cell, finish):
    """Twice as fine as the default changes the reading by no more than 0.2 % beyond the noise of the light."""
    default = read(cell, finish, fz=-2, points=1 << 10)
    fine = read(cell, replace(finish, refinement=2 * finish.refinement), fz=-2, subdivision=24, points=1 << 10)
    change = (fine.replicates - default.replicates).ravel() / default.power[0]
    error = change.std(ddof=1) / np.sqrt(len(change))
    assert error < 2e-3
    assert abs(change.mean()) < 2e-3 + 4 * error


@pytest.mark.parametrize("finish", [Grooves(0.5, 1e-3), RandomRoughness(5e-4, 0.5)])
def test_slight_roughness_reads_as_a_smooth_wall(llvm_mono, agree, finish):
    rough, smooth = (read("cylindrical", kind, fz=-2) for kind in (finish, None))
    agree(rough.power, rough.standard_error, smooth.power, smooth.standard_error)


def test_steps_that_a_flat_cell_has_no_use_for_change_nothing(llvm_mono, agree):
    rough, smooth = (read("parallelepiped", kind) for kind in (LayerSteps(0.31), None))
    agree(rough.power, rough.standard_error, smooth.power, smooth.standard_error)


def test_a_roof_moved_by_half_a_layer_reads_as_a_cell_of_that_height(llvm_mono, agree):
    rough = read("parallelepiped", LayerSteps(0.2))
    higher = replace(sensor("parallelepiped", None), pad=Pad("parallelepiped", rows=1, columns=1, cell_height=1.6))
    expected = measure(higher.scene(), points=1 << 11, seed=4)
    agree(rough.power, rough.standard_error, expected.power, expected.standard_error)
    smooth = read("parallelepiped", None)
    assert smooth.power[0] - rough.power[0] > 10 * np.hypot(rough.standard_error[0], smooth.standard_error[0])


@pytest.mark.parametrize(
    "finish",
    [
        LayerSteps(0.3, (0, 0.6, 0.8), offset=-0.1),
        Grooves(0.4, 0.05, (1, 1, 0)),
        RandomRoughness(0.02, 0.5, 7, 2.0),
        SeparateFinish(LayerSteps(0.2), RandomRoughness(0.02, 0.5)),
        SeparateFinish(side=Grooves(0.4, 0.05, refinement=0.5)),
    ],
)
def test_a_finish_from_python_written_as_xml_reads_the_same_to_the_bit(llvm_mono, tmp_path, finish):
    scene = sensor("hemispheric", finish, fz=-1).scene()
    scene.write_xml(tmp_path / "rough.xml")
    scenes = scene, Scene.from_file(tmp_path / "rough.xml")
    ours, theirs = (measure(s, points=256, seed=4, mechanics_error=False) for s in scenes)
    assert np.array_equal(ours.replicates, theirs.replicates)


def test_refinements_that_a_scene_cannot_state_are_refused():
    finish = SeparateFinish(LayerSteps(0.2, refinement=2.0), RandomRoughness(0.02, 0.5))
    with pytest.raises(InputError, match="finish_refinement = 2 for roof and 4 for side is not allowed"):
        sensor("hemispheric", finish)
