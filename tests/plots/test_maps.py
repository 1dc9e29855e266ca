"""Maps of readings: over which parameters, and of what."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.plots.maps import plane_of, plot_map

pytestmark = pytest.mark.quick


def study(taxels=9, **varied):
    shape = [len(values) for values in varied.values()]
    power = np.arange(np.prod(shape) * taxels, dtype=float).reshape(*shape, taxels) * 1e-6
    coords = {**varied, "taxel": np.arange(1, taxels + 1)}
    made = xr.Dataset({"power": ([*varied, "taxel"], power)}, coords=coords)
    for name in varied:
        made[name].attrs["units"] = "mm"
    return made


X, Y = np.arange(-2, 3.0), np.arange(-1, 2.0)


@pytest.mark.parametrize(
    ("varied", "plane"),
    [
        ({"indenter_x": X, "indenter_y": Y}, ("indenter_x", "indenter_y")),
        ({"depth": [0.1, 0.2], "fy": Y, "fx": X}, ("fx", "fy")),
        ({"indenter_x": X, "dy": Y}, None),
        ({"indenter_x": X, "indenter_y": [0.0]}, None),
        ({"x": ["a", "b"], "y": Y}, None),
        ({"fz": X}, None),
    ],
)
def test_parameters_of_a_map(varied, plane):
    assert plane_of(study(**varied)) == plane


def test_each_taxel_has_its_map():
    made = study(depth=[0.1, 0.2], indenter_x=X, indenter_y=Y)
    figure = plot_map(made)
    panels = [ax for ax in figure.axes if ax.get_title().startswith("taxel")]
    assert [ax.get_title() for ax in panels] == [f"taxel {n}" for n in range(1, 10)]
    for number, ax in enumerate(panels):
        values = np.asarray(ax.collections[0].get_array()).reshape(len(Y), len(X))
        np.testing.assert_allclose(values, 1e6 * made.power.sel(depth=0.2).values[..., number].T)
    assert figure.get_suptitle() == "depth = 0.2" and figure.axes[-1].get_ylabel() == "optical power [µW]"
    assert panels[-1].get_xlabel() == "indenter_x [mm]"


def test_taxels_that_find_no_place_are_told():
    figure = plot_map(study(taxels=16, dx=X, dy=Y), narrow=True)
    assert figure.get_suptitle() == "4 taxels, which change less, are not shown"


@pytest.mark.parametrize(("narrow", "labelled"), [(False, [2, 3, 4]), (True, [4])])
def test_panels_with_none_below_have_labels(narrow, labelled):
    """Also those above a place that stays empty."""
    panels = plot_map(study(taxels=5, dx=X, dy=Y), narrow=narrow).axes[:5]
    assert [number for number, ax in enumerate(panels) if ax.get_xlabel() == "dx [mm]"] == labelled
    assert [number for number, ax in enumerate(panels) if ax.xaxis.get_tick_params()["labelbottom"]] == labelled
