"""A target for slopes: what a mesh takes for it, and what is said where it is not reached."""

from __future__ import annotations

from types import SimpleNamespace

import click
import numpy as np
import pytest
from one_cell import one_cell
from taxel_cli.tables import end_beyond_target

from mitsuba_taxel import ComputationError, InputError, Scene, open_study, sweep
from mitsuba_taxel.base.convergence import SLOPE_ORDER
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
from mitsuba_taxel.studies.run import slope_meshes
from mitsuba_taxel.studies.store.slope_target import missed_slopes

PAD = one_cell(cell="cylindrical", mesh_size="$size", scattering="$roof", fz=0, size=1.7, roof="lambertian")


@pytest.fixture
def pad(tmp_path):
    (tmp_path / "pad.xml").write_text(PAD)
    return tmp_path / "pad.xml"


def test_the_error_is_relative_to_the_steepest_slope_by_the_same_force():
    values, errors = np.array([[10.0, 0.1], [0.0, -0.2]]), np.array([[0.1, 0.0], [0.2, 0.01]])
    found = Derivatives(
        ("fx", "fz"), ("W/N", "W/N"), values, errors, np.ones(2), np.zeros(2), 0.0, np.zeros(2), 0.5, np.zeros(2)
    )
    assert slope_meshes.slope_share(found) == pytest.approx(max(0.2 / 10, 0.01 / 0.2))


@pytest.mark.parametrize(("target", "sizes"), [(0.5, 1), (0.04, 2), (0.03, 4), (1e-6, 4)])
def test_meshes_get_finer_until_the_target_is_reached_or_none_is_left(pad, monkeypatch, target, sizes):
    """Errors fall with the square of the size; the third mesh is too fine, one halfway to it is not."""
    tried = []

    def read(changes, size, of_light_alone):
        tried.append(size)
        if size < 0.4:
            raise ComputationError("too fine")
        error, one = np.full((1, 1), 0.1 * size**2), np.ones(1)
        return Derivatives(("fz",), ("W/N",), np.ones((1, 1)), error, one, 0 * one, 0.0, 0 * one, 0.5, 0 * one)

    def finer(scene, ready, known, wanted, order):
        assert order == SLOPE_ORDER
        return None if known[-1][1] <= wanted else known[-1][0] / 2

    monkeypatch.setattr("mitsuba_taxel.sensing.derivatives.diffuse_derivatives.derivatives_by", read)
    monkeypatch.setattr("mitsuba_taxel.sensing.derivatives.scene_rates.rates", lambda scene, name: name)
    monkeypatch.setattr(slope_meshes, "prepare", lambda scene: SimpleNamespace(scene=scene.mesh_size or 1.2))
    monkeypatch.setattr(slope_meshes, "smallest_mesh_size", lambda ready, loaded: ready.scene)
    monkeypatch.setattr(slope_meshes, "finer_mesh", finer)
    chosen = slope_meshes._mesh_size(Scene(pad), ["fz"], target)
    assert tried == pytest.approx([1.2, 0.6, 0.3, 0.6 * 0.9**3][:sizes])
    assert chosen == (None if sizes == 1 else tried[-1])


def test_a_target_that_is_not_reached_is_told(pad, tmp_path):
    study = sweep(pad, {"fz": "0:-0.4:-0.4"}, points=16, target_slope=1e-5, output=tmp_path / "out")
    (note, *_) = study.attrs["notes"].splitlines()
    assert note.startswith("target slope 1e-05 not reached: the worst error is 0.0")
    assert open_study(tmp_path / "out").attrs["notes"] == study.attrs["notes"]
    with pytest.raises(click.exceptions.Exit) as end:
        end_beyond_target([note])
    assert end.value.exit_code == 3


def test_slopes_that_are_not_known_do_not_reach_a_target(pad):
    """Two loads give no curve, so the derivatives of the mirror are differences of random paths at each load."""
    study = sweep(pad, {"fz": "0:-0.2:-0.2", "roof": "lambertian,mirror"}, points=16, derivatives=["fz"])
    assert set(study.derivative_method.sel(roof="mirror").values.ravel()) == {"differences of random paths"}
    assert missed_slopes(study.sel(roof=["lambertian"]), 0.9) == []
    unknown = study.assign(derivative_error=study.derivative_error.where(study.roof == "lambertian"))
    (note,) = missed_slopes(unknown, 0.9)
    assert note.endswith("the worst error is unknown")


def test_a_target_that_is_reached_is_not(pad):
    study = sweep(pad, {"fz": "0:-0.4:-0.4"}, points=16, target_slope=0.5)
    assert study.parameter.values.tolist() == ["fz"] and "target" not in study.attrs["notes"]
    assert study.attrs["target_slope"] == 0.5


def test_the_first_and_the_last_scene_of_a_curve_are_examined(pad, monkeypatch, error_unknown_here):
    """The last one on the mesh that the first one needs; the study takes the finer of both."""
    examined, sizes = [], iter([1.5, 1.4])

    def mesh_size(scene, forces, target):
        examined.append((float(scene.parameters["fz"]), scene.mesh_size))
        return next(sizes)

    monkeypatch.setattr(slope_meshes, "_mesh_size", mesh_size)
    study = sweep(pad, {"fz": "0:-0.4:-0.2"}, points=16, target_slope=0.5)
    assert [force for force, _ in examined] == [0, -0.4]
    assert examined[1][1] == 1.5 and study.attrs["mesh_size"] == 1.4


@pytest.mark.parametrize(
    ("vary", "target"), [({"fz": "0:-1:-1"}, 2), ({"fz": "0:-1:-1"}, "1%"), ({"size": "1,2"}, 0.1)]
)
def test_what_is_no_target_is_refused(pad, vary, target):
    with pytest.raises(InputError, match="target_slope = .* is not allowed"):
        sweep(pad, vary, points=16, target_slope=target)
