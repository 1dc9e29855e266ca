"""Readings relative to a base state: which scenes have them, and that they are the same readings with less noise."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import Pad, PadSensor, Scene, Wall
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.sensing.reading.mechanics_error import mechanics_deviations
from mitsuba_taxel.sensing.reading.paired import can_be_paired, paired, paired_with
from mitsuba_taxel.sensing.reading.runs import Run, prepare
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.photo_reflector import PhotoReflector

FINISH = '<string name="finish" value="layer_steps"/> <float name="layer_height" value="0.2"/>'


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """A spherical cell from a printed mould, whose elements are finer with a load than without."""
    file = tmp_path_factory.mktemp("printed") / "pad.xml"
    text = one_cell(cell="spherical", scattering="$roof", fz=0, roof="lambertian")
    text = text.replace('<float name="mesh_size" value="2.5"/>', FINISH)
    file.write_text(text)
    return file


def powers(ready, points, seed=0):
    run = Run(ready, seed)
    run.extend_to(points // 2)
    run.extend_to(points)  # in two steps, as a study that is continued
    return run.powers[:, 0]


def test_paired_readings_are_the_same_readings_with_less_noise_between_loads(printed):
    """Z-tests at 4 standard deviations (false alarms 6e-5 each); the slope has a third of the noise or less."""
    base, rest = (Scene(printed, {"fz": force}) for force in ("-0.8", "0"))
    loaded, unloaded = paired(base, base), paired(base, rest)
    assert loaded.paired is not None and unloaded.paired is not None
    related = [powers(ready, 1024) for ready in (loaded, unloaded)]
    plain = [powers(prepare(scene), 1024, seed=1) for scene in (base, rest)]
    for one, other in zip(related, plain, strict=True):
        assert abs(one.mean() - other.mean()) < 4 * np.hypot(standard_error(one), standard_error(other))
    slopes = [second - first for first, second in (related, plain)]
    assert abs(slopes[0].mean() - slopes[1].mean()) < 4 * np.hypot(*map(standard_error, slopes))
    assert 3 * standard_error(slopes[0]) < standard_error(slopes[1])


def test_changes_by_the_mechanics_are_those_of_displaced_pads(printed):
    """Z-tests at 4 standard deviations (false alarms 6e-5 each) against readings that share their random numbers."""
    base = Scene(printed, {"fz": "-0.8"})
    related, plain = paired(base, base), prepare(base)
    _, changes = related.paired.deviations(0, 256)
    _, other_changes = mechanics_deviations(plain.scene, lambda: powers(plain, 512)[:, None])
    for change, other in zip(changes[..., 0], other_changes[..., 0], strict=True):
        assert abs(change.mean() - other.mean()) < 4 * np.hypot(standard_error(change), standard_error(other))
        assert standard_error(change) < standard_error(other)


@pytest.mark.parametrize(("roof", "is_paired"), [("lambertian", True), ("isotropic", True), ("mirror", False)])
def test_mirrors_have_no_paths_between_given_points(printed, roof, is_paired):
    scene = Scene(printed, {"fz": "-0.8", "roof": roof})
    assert can_be_paired(prepare(scene)) == is_paired
    assert (paired(scene, Scene(printed, {"fz": "-0.4", "roof": roof})).paired is not None) == is_paired


def test_scenes_of_python_are_not_mistaken_for_their_base():
    """Scenes without parameters, which differ in what they contain."""
    pad, walls = Pad("spherical", rows=1, columns=1), {"roof": Wall("lambertian", reflectance=0.9)}
    base, scene = (PadSensor(pad, force=(0, 0, force), **walls).scene() for force in (-0.8, -0.4))
    assert base.parameters == scene.parameters
    first, second = (powers(paired(base, state), 64) for state in (base, scene))
    assert np.abs(second - first).min() > 0


@pytest.mark.parametrize("law", [{}, {"law": "uniform_solid_angle", "cone_angle": 1.0}])
def test_differences_with_less_noise_are_chosen(law):
    """Moved paths leave a narrow beam; the variances of both kinds differ by more than ten times either way."""
    pad, reflector = Pad("spherical", rows=1, columns=1), PhotoReflector(led=AnnularLed(**law))
    base, scene = (
        PadSensor(pad, photo_reflector=reflector, force=(0, 0, force), roof=Wall("lambertian", reflectance=0.9)).scene()
        for force in (-0.8, -0.4)
    )
    loaded = prepare(base)
    both = [paired_with(base, loaded, scene), prepare(scene)]
    at_base, *others = (powers(ready, 1024, seed=3) for ready in (loaded, *both))
    by_points, shared = (standard_error(other - at_base) ** 2 for other in others)
    assert max(by_points / shared, shared / by_points) > 10
    assert (paired(base, scene).paired is not None) == (by_points < shared)


def test_a_base_that_is_refused_leaves_the_scene_as_it_is(printed):
    assert paired(Scene(printed, {"fz": "-0.8", "roof": "loud"}), Scene(printed, {"fz": "-0.8"})).paired is None
