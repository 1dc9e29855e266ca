"""Resolutions by the Fisher information: closed forms, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.characterise import resolution
from mitsuba_taxel.electronics import respond, total_noise
from mitsuba_taxel.plots.figures import save_figure
from mitsuba_taxel.plots.maps import plot_resolution

CIRCUIT = Circuit(supply=3.3, load_resistance=1e4, transfer=5e-2, current_gain=100.0)


def study(slopes, power=2e-6):
    """A study at two places along x and three along y, of slopes (taxels, 2) that double with x."""
    slopes = np.array(slopes, dtype=float)
    every = np.array([1.0, 2.0])[:, None, None, None] * np.broadcast_to(slopes, (3, *slopes.shape))
    dims = ["patch_x", "patch_y", "taxel"]
    return xr.Dataset(
        {
            "smooth_power": (dims, np.full(every.shape[:-1], power)),
            "replicate_power": ([*dims, "replicate"], np.full((*every.shape[:-1], 2), power)),
            "derivative": ([*dims, "parameter"], every),
        },
        {
            "patch_x": [0.0, 1.0], "patch_y": [-1.0, 0.0, 1.0], "parameter": ["fz", "patch_x"],
            "derivative_unit": ("parameter", ["W/N", "W/mm"]),
        },
    )  # fmt: skip


def test_two_readings_of_two_unknowns():
    """With slopes 3 and 4 of one reading, and 0 and 2 of the other: the first unknown is hidden by the second."""
    found = resolution(study([[3, 4], [0, 2]]), noise=0.1)
    here = found.isel(patch_x=0, patch_y=1)
    np.testing.assert_allclose(here.resolution, [0.1 * np.hypot(1, 2) / 3, 0.1 / 2])
    np.testing.assert_allclose(here.covariance, 0.01 * np.linalg.inv([[9, 12], [12, 20]]))
    np.testing.assert_allclose(found.resolution.isel(patch_x=1), found.resolution.isel(patch_x=0) / 2)
    assert found.unit.values.tolist() == ["N", "mm"]


def test_behind_a_circuit():
    found = resolution(study(np.diag([1e-7, 2e-7])), circuit=CIRCUIT).resolution
    expected = total_noise(CIRCUIT, np.array(2e-6)) / respond(CIRCUIT, np.array(2e-6)).rate / 1e-7
    np.testing.assert_allclose(found.isel(patch_x=0, patch_y=0), [expected, expected / 2])


def test_what_readings_do_not_tell():
    made = study([[1, 2], [2, 4], [3, 6]])
    made.derivative[0, 0] = np.nan
    found = resolution(made, noise=1.0).resolution
    assert np.isnan(found[0, 0]).all() and np.isinf(found[1]).all() and np.isinf(found[0, 1:]).all()
    assert np.isinf(resolution(study([[1, 0], [2, 0]]), noise=1.0).resolution).all()


@pytest.mark.parametrize(
    ("made", "about", "said"),
    [
        (study(np.eye(2)).drop_vars("derivative"), {"noise": 1.0}, "a study with derivatives"),
        (study(np.eye(2)), {}, "a circuit, or the noise"),
        (study(np.eye(2)), {"noise": -1.0}, "noise = -1.0 is not allowed"),
    ],
)
def test_what_is_refused(made, about, said):
    with pytest.raises(InputError, match=said):
        resolution(made, **about)


def test_its_map():
    found = resolution(study([[3, 4], [0, 2]]), noise=0.1)
    for name in ("patch_x", "patch_y"):
        found[name].attrs["units"] = "mm"
    figure = plot_resolution(found)
    panels = [ax for ax in figure.axes if ax.get_title()]
    assert [ax.get_title() for ax in panels] == ["fz", "patch_x"] and panels[1].get_xlabel() == "patch_x [mm]"
    drawn = np.asarray(panels[1].collections[0].get_array()).reshape(3, 2)
    np.testing.assert_allclose(drawn, 1e3 * found.resolution[..., 1].T)
    assert [ax.get_ylabel() for ax in figure.axes][2:] == ["1 sigma [mN]", "1 sigma [µm]"]


def test_a_map_of_what_readings_do_not_tell(tmp_path, painted_figures):
    """One taxel for two unknowns, as where a small sensor is read."""
    figure = plot_resolution(resolution(study([[3, 4]]), noise=0.1))
    save_figure(figure, tmp_path, "resolution")
    assert [ax.get_title() for ax in figure.axes] == [f"{name}: not told by the readings" for name in ("fz", "patch_x")]
