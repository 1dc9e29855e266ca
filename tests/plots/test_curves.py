"""Plots come out for every kind of study."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PolyCollection
from PIL import Image

from mitsuba_taxel.plots.curves import plot_curves, plot_taxels


@pytest.mark.parametrize(
    "varied, curve, taxels",
    [
        ({"fz": [0.0, -1, -2]}, "fz", 9),
        ({"z": [0.7]}, "z", 1),
        ({"cell": ["parallelepiped", "hemispheric"]}, "cell", 9),
        ({"cell": ["a", "b", "c"], "fz": [0.0, -1]}, "fz", 12),
        ({"a": np.arange(4.0), "b": np.arange(5.0), "z": [1.0, 2]}, "z", 1),
    ],
    ids=["force", "one scene", "words", "two parameters", "more panels than shown"],
)
@pytest.mark.usefixtures("painted_figures")
def test_plot(tmp_path, varied, curve, taxels):
    shape = [len(values) for values in varied.values()]
    power = np.random.default_rng(0).normal(1, 0.1, (*shape, 4, taxels))
    total = np.full((*shape, taxels), 0.05)
    study = xr.Dataset(
        {"replicate_power": ([*varied, "replicate", "taxel"], power), "total_error": ([*varied, "taxel"], total)},
        coords={**varied, "taxel": np.arange(1, taxels + 1)},
        attrs={"curve": curve, "scene": "scene.xml"},
    )
    plot_curves(study).savefig(tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as image:
        assert image.width > 600 and image.height > 300 and len(image.getcolors(1 << 20)) > 10


@pytest.mark.usefixtures("painted_figures")
def test_curves_go_through_readings_with_their_slopes(tmp_path, monkeypatch):
    """A cubic is drawn as what it is, from its ends alone, and the total error of the readings beside it."""
    force, taxel = np.array([-4.0, 0.0]), [1, 2]
    value, rate = np.polyval([0.1, 1, 0, 5], force), np.polyval([0.3, 2, 0], force)
    both = {"fz": force, "taxel": taxel}
    study = xr.Dataset(
        {
            "replicate_power": (["fz", "replicate", "taxel"], np.random.default_rng(0).normal(size=(2, 4, 2))),
            "total_error": (["fz", "taxel"], np.full((2, 2), 0.05)),
            "smooth_power": (["fz", "taxel"], np.stack([value, 2 * value], axis=1)),
            "derivative": (["fz", "taxel", "parameter"], np.stack([rate, 2 * rate], axis=1)[:, :, None]),
        },
        coords={**both, "parameter": ["fz"]},
        attrs={"curve": "fz", "scene": "scene.xml"},
    )
    drawn = []
    monkeypatch.setattr("matplotlib.axes.Axes.plot", lambda ax, x, y, **style: drawn.append((x, y)))
    figure = plot_curves(study)
    figure.savefig(tmp_path / "plot.png")
    bands = [each for each in figure.axes[0].collections if isinstance(each, PolyCollection)]
    for band, middle in zip(bands, study.replicate_power.mean("replicate").values.T, strict=True):
        ends = band.get_paths()[0].get_extents().intervaly
        np.testing.assert_allclose(ends, (middle.min() - 0.05, middle.max() + 0.05))
    assert len(drawn) == 4  # and how both differ from their mean
    for (x, y), factor in zip(drawn, (1, 2, -0.5, 0.5), strict=True):
        np.testing.assert_allclose(y, factor * np.polyval([0.1, 1, 0, 5], x))


@pytest.mark.parametrize("count", [64, 100])
@pytest.mark.parametrize("plot", [plot_curves, plot_taxels])
def test_of_more_than_64_taxels_those_that_change_most_are_drawn(plot, count):
    """Every seventh changes by a tenth or more, and more the higher its number."""
    taxel = np.arange(1, count + 1)
    change = np.where(taxel % 7 == 0, 0.1 + 1e-3 * taxel, 0.01)
    power = 1 - np.array([0.0, 0.5, 1.0])[:, None, None] * change
    power = np.repeat(power, 4, axis=1)
    dims, coords, attrs = ["fz", "replicate", "taxel"], {"fz": [0.0, -1, -2]}, {"curve": "fz", "scene": "scene.xml"}
    study = xr.Dataset(
        {"replicate_power": (dims, power), "total_error": (["fz", "taxel"], 0.001 * power[:, 0])},
        coords={**coords, "taxel": taxel},
        attrs=attrs,
    )
    (legend,) = plot(study).legends
    drawn = [int(text.get_text()) for text in legend.get_texts()]
    if count == 64:
        assert drawn == taxel.tolist() and "most" not in legend.get_title().get_text()
    else:
        assert drawn == [42, 49, 56, 63, 70, 77, 84, 91, 98]
        assert legend.get_title().get_text().endswith("9 of 100,\nwhich change most")
