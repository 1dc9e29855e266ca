"""Maps of many taxels over the sensor: what is drawn where, in which colour, and when."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.plots.maps import plot_map
from mitsuba_taxel.plots.pad_maps import has_pad_map, plot_pad_map

pytestmark = pytest.mark.quick

X, Y = np.linspace(-6, 6, 5), np.linspace(-4, 4, 3)


def touched(across=10, pitch=2.5, **varied):
    """Readings, in W, that fall with the distance of a taxel from the contact; row by row from (-x, +y)."""
    axis = pitch * (np.arange(across) - (across - 1) / 2)
    x, y = np.tile(axis, across), np.repeat(-axis, across)
    varied = varied or {"indenter_x": X, "indenter_y": Y}
    at = np.stack(np.meshgrid(*varied.values(), indexing="ij"), axis=-1)
    power = 1e-3 * (1 + np.exp(-np.hypot(at[..., :1] - x, at[..., 1:2] - y)))
    positions = {"taxel_x": ("taxel", x, {"units": "mm"}), "taxel_y": ("taxel", y, {"units": "mm"})}
    coords = {name: (name, values, {"units": "mm"}) for name, values in varied.items()}
    variables = {"power": ([*varied, "taxel"], power, {"units": "W"}), **positions}
    return xr.Dataset(variables, coords={**coords, "taxel": np.arange(1, x.size + 1)})


def panels(figure):
    return [ax for ax in figure.axes if ax.get_title()]


def test_each_square_is_at_its_taxel_and_the_brightest_is_below_the_cross():
    study = touched()
    axes = panels(plot_pad_map(study))
    assert len(axes) == 12
    for ax in axes:
        (squares,) = ax.collections
        corners = np.array([path.vertices[:4] for path in squares.get_paths()])
        places = np.stack([study.taxel_x.values, study.taxel_y.values], axis=1)
        np.testing.assert_allclose(corners.mean(axis=1), places, atol=1e-12)
        np.testing.assert_allclose(np.ptp(corners, axis=1), 2.5)
        (cross,) = ax.lines
        contact = np.array([cross.get_xdata()[0], cross.get_ydata()[0]])
        brightest = places[np.asarray(squares.get_array()).argmax()]
        assert np.abs(brightest - contact).max() <= 1.25 + 1e-9
        words = ax.get_title().splitlines()
        assert words == [f"indenter_x = {contact[0]:.6g} mm", f"indenter_y = {contact[1]:.6g} mm"]
    assert len({ax.collections[0].get_clim() for ax in axes}) == 1
    assert axes[0].figure.get_suptitle() == "12 of 15 scenes; 3 are not shown"
    assert axes[0].figure.axes[-1].get_ylabel() == "optical power [mW]"


@pytest.mark.parametrize("narrow", [False, True])
def test_scenes_without_a_reading_are_left_out(narrow):
    study = touched()
    study.power[0] = study.power[4, 1] = np.nan
    axes = panels(plot_pad_map(study, narrow))
    assert len(axes) == 11 and not axes[0].figure.get_suptitle()
    assert not any(ax.get_title().startswith("indenter_x = -6 ") for ax in axes)
    assert (axes[0].get_xlabel() == "x [mm]") is narrow and axes[-1].get_xlabel() == "x [mm]"


def test_without_a_varied_contact_there_is_no_cross():
    axes = panels(plot_pad_map(touched(fz=np.array([0.0, -4.0]), dx=np.zeros(1))))
    assert [ax.get_title().splitlines()[0] for ax in axes] == ["fz = 0 mm", "fz = -4 mm"]
    assert not any(ax.lines for ax in axes)


def test_only_many_taxels_with_positions_are_mapped():
    assert has_pad_map(touched(across=9))
    assert not has_pad_map(touched(across=8))
    assert not has_pad_map(touched().drop_vars("taxel_x"))


def test_a_map_over_places_shows_the_taxels_that_change_most():
    study = touched(indenter_x=np.array([6.25, 8.75]), indenter_y=np.array([3.75, 6.25]))
    figure = plot_map(study)
    shown = [int(ax.get_title().split()[1]) for ax in figure.axes if ax.get_title()]
    change = np.ptp(study.power.values.reshape(-1, 100), axis=0)
    assert shown == sorted(np.argsort(-change, kind="stable")[:12] + 1)
    assert figure.get_suptitle() == "88 taxels, which change less, are not shown"
    near = study.isel(taxel=np.array(shown) - 1)
    assert near.taxel_x.min() > 2 and near.taxel_y.min() > 0
