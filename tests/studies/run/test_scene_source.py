"""Studies of scenes that are not files: made in Python, or files with other values."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError, PhotoReflector, Scene, Wall, measure, sweep
from mitsuba_taxel.studies.store.status import study_status


def plate(reflectance=0.8):
    """A sphere above a photo-reflector."""
    ball = {"type": "sphere", "radius": 2.0, "center": [0, 0, 3.5], "skin": Wall("lambertian", reflectance).to_dict()}
    parts = {"reflector": PhotoReflector().to_dict(), "ball": ball}
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, **parts})


RUN = {"points": 64, "seed": 1}


def test_a_scene_made_in_python_can_be_swept(tmp_path, llvm_mono):
    """The readings are those of scenes with these values; with a folder it resumes, from there as well."""
    vary = {"skin_reflectance": [0.4, 0.8]}
    study = sweep(plate(), vary, **RUN)
    direct = [measure(plate(value), **RUN).power[0] for value in (0.4, 0.8)]
    np.testing.assert_array_equal(study.power.values.ravel(), direct)
    folder = tmp_path / "out"
    for source in (plate(), plate(), folder / "study_scene.xml"):
        kept = sweep(source, vary, output=folder, **RUN)
        np.testing.assert_array_equal(kept.power, study.power)
    assert [row.done for row in study_status(folder)] == [2]
    with pytest.raises(InputError, match="holds another study .the <default> skin_reflectance is 0.7 instead of 0.8"):
        sweep(plate(0.7), vary, output=folder, **RUN)
    with pytest.raises(InputError, match="reflectance is not a parameter of scene.xml: allowed are .*radius"):
        sweep(plate(), {"reflectance": [1]}, **RUN)
    for stored in (100_000 * "<a>" + 100_000 * "</a>", "<a>"):  # of somebody else
        (folder / "study_scene.xml").write_text(stored)
        with pytest.raises(InputError, match="holds another study"):
            sweep(plate(), vary, output=folder, **RUN)


def test_a_scene_with_other_values_than_its_file_is_swept_with_these(llvm_mono):
    """What is varied or defined comes before."""
    scene = Scene.from_file("plate.xml", z=1.5, scattering="isotropic", law="lambertian")
    study = sweep(scene, {"z": "1,2"}, {"law": "uniform_solid_angle"}, **RUN)
    expected = sweep("plate.xml", {"z": "1,2"}, {"scattering": "isotropic"}, **RUN)
    np.testing.assert_array_equal(study.power, expected.power)
