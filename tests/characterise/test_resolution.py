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


def with_errors(slopes, errors):
    made = study(slopes)
    return made.assign(derivative_error=(made.derivative.dims, np.broadcast_to(errors, made.derivative.shape)))


def test_the_error_of_one_unknown_has_a_closed_form():
    """N / J of one reading changes by the relative error of J, common to readings or of its own: both add in squares.
    Of four equal readings, the second kind averages out to half."""
    one = resolution(with_errors([[2.0, 0.0]], [0.02, 0.0]).isel(parameter=[0]), noise=0.1).isel(patch_x=0, patch_y=0)
    np.testing.assert_allclose(one.resolution_error / one.resolution, [0.01 * np.sqrt(2)])
    four = resolution(with_errors([[2.0, 0.0]] * 4, [0.02, 0.0]).isel(parameter=[0]), noise=0.1)
    np.testing.assert_allclose(
        (four.resolution_error / four.resolution).isel(patch_x=0), np.full((3, 1), 0.01 * np.sqrt(1.25))
    )
    assert np.isnan(resolution(study(np.eye(2)), noise=0.1).resolution_error).all()


@pytest.mark.parametrize("common", [0.0, 0.5, 1.0])
def test_the_errors_of_resolutions_hold_whatever_the_correlation_of_those_of_derivatives(common):
    """Of 300 sensors of nine taxels for three unknowns each, as many errors are within twice the stated one as of
    normal ones, but for three points; the stated one is at most five times the true one in the median."""
    random, units = np.random.default_rng(5), [f"W/{name}" for name in ("N", "N", "mm")]
    shape = (300, 9, 3)
    true = random.normal(size=shape) + 0.5
    size = 0.02 * np.sqrt((true**2).mean(axis=1, keepdims=True)) * np.ones(shape)
    own, shared = random.normal(size=shape), np.sign(true) * random.normal(size=(300, 1, 3))
    read = true + size * (np.sqrt(1 - common) * own + np.sqrt(common) * shared)

    def found(slopes):
        dims = ["case", "taxel", "parameter"]
        named = {"parameter": ["fx", "fz", "patch_x"], "derivative_unit": ("parameter", units)}
        readings = {"smooth_power": (dims[:2], np.ones(shape[:2]))}
        return resolution(
            xr.Dataset({**readings, "derivative": (dims, slopes), "derivative_error": (dims, size)}, named), 1.0
        )

    stated, off = found(read).resolution_error, np.abs(found(read).resolution - found(true).resolution)
    assert (off <= 2 * stated).mean() > 0.9545 - 0.03 and 1 < float((stated / off).median()) < 5


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
    assert "fz, ±1.4 % at most" in [
        ax.get_title() for ax in plot_resolution(found.assign(resolution_error=0.014 * found.resolution)).axes
    ]
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
    titles = [f"{name}: not determined by the readings" for name in ("fz", "patch_x")]
    assert [ax.get_title() for ax in figure.axes] == titles
