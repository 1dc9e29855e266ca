"""Plots come out for every kind of study."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from mitsuba_taxel.plots.curves import plot_curves


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
def test_plot(tmp_path, varied, curve, taxels):
    shape = [len(values) for values in varied.values()]
    power = np.random.default_rng(0).normal(1, 0.1, (*shape, 4, taxels))
    total = np.full((*shape, taxels), 0.05)
    study = xr.Dataset(
        {"replicate_power": ([*varied, "replicate", "taxel"], power), "total_error": ([*varied, "taxel"], total)},
        coords={**varied, "taxel": np.arange(1, taxels + 1)},
        attrs={"curve": curve, "scene": "scene.xml"},
    )
    plot_curves(study, tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as image:
        assert image.width > 600 and image.height > 300 and len(image.getcolors(1 << 20)) > 10
