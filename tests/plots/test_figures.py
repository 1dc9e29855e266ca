"""Which curves lie in one panel, and what their axes are."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from mitsuba_taxel import Circuit
from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise import Branch, Experiment
from mitsuba_taxel.electronics import in_volts
from mitsuba_taxel.plots.characteristics import parameters_of, plot_against, plot_sensitivity
from mitsuba_taxel.plots.curves import has_taxels_to_compare, plot_curves, plot_taxels
from mitsuba_taxel.plots.figures import axes_of, compared, save_small

FORCE = np.array([0.0, -5, -10])


@pytest.mark.parametrize(
    "largest, unit, factor, words",
    [
        (3.7e-3, "W", 1e-3, "mW"),
        (1e-3, "W", 1e-3, "mW"),
        (999e-6, "W/N", 1e-6, "µW/N"),
        (12.0, "W", 1.0, "W"),
        (4e4, "V", 1e3, "kV"),
        (0.002, "%/N", 1.0, "%/N"),
        (0.0, "W", 1.0, "W"),
        (1e-40, "W", 1e-15, "fW"),
    ],
)
def test_prefix(largest, unit, factor, words):
    assert prefixed(largest, unit) == (pytest.approx(factor), words)


def cases(**numbers):
    grid = np.indices(tuple(numbers.values())).reshape(len(numbers), -1).T
    return [dict(zip(numbers, row.tolist(), strict=True)) for row in grid]


@pytest.mark.parametrize(
    "varied, panels, lines, left_out",
    [
        ({"a": 4}, 1, 4, 0),
        ({"a": 3, "b": 3}, 1, 9, 0),
        ({"a": 4, "b": 5}, 4, 5, 0),
        ({"a": 40}, 1, 9, 31),
        ({"a": 2, "b": 20}, 12, 2, 16),
    ],
)
def test_few_curves_share_a_panel(varied, panels, lines, left_out):
    found, missing = compared(cases(**varied), lambda case: case)
    assert len(found) == panels and {len(panel.cases) for panel in found} == {lines} and missing == left_out


def study(taxels=9, **varied):
    """Readings of 4 mW that fall by 1 % per N, more so where parameters are larger."""
    shape = [len(values) for values in varied.values()]
    size = 1 + np.indices(shape).sum(axis=0)
    power = 4e-3 * (1 - 0.01 * size[..., None] * FORCE)[..., None, None] * np.ones((4, taxels))
    dims = [*varied, "fz", "replicate", "taxel"]
    return xr.Dataset(
        {
            "replicate_power": (dims, power),
            "total_error": ([*varied, "fz", "taxel"], np.full((*shape, 3, taxels), 1e-5)),
        },
        coords={**varied, "fz": ("fz", FORCE, {"units": "N"}), "taxel": np.arange(1, taxels + 1)},
        attrs={"curve": "fz", "scene": "scene.xml"},
    )


def test_shapes_are_compared_in_one_panel_from_force_0():
    one = study(cell=["a", "b"])
    figure = plot_curves(one)
    above, below = figure.axes
    assert above.get_ylabel() == "power of taxel 1, which changes most [mW]"
    assert below.get_ylabel() == "change since fz = 0 [%]"
    assert above.xaxis_inverted() and len(above.containers) == len(below.containers) == 2
    np.testing.assert_allclose(below.containers[1].lines[0].get_ydata(), [0, 10, 20])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["cell = a", "cell = b"]
    assert has_taxels_to_compare(one) and not has_taxels_to_compare(study())
    figure = plot_taxels(one)
    first, second = figure.axes
    assert first.get_ylim() == second.get_ylim() and len(first.containers) == 9


def test_taxels_of_one_curve_lie_in_one_panel():
    figure = plot_curves(study())
    above, below = figure.axes
    assert above.get_ylabel() == "optical power [mW]" and len(above.containers) == len(below.containers) == 9


def test_volts_have_counts_beside_them():
    """Of a converter of 1 mV a count, behind a resistor that brings 1 V per 4 mW."""
    circuit = Circuit(supply=5.0, load_resistance=1e3, transfer=0.25, saturation_voltage=0.0, adc_reference=4.096)
    watts = study().assign_attrs(circuit=json.dumps(circuit.as_table()))
    assert not plot_curves(watts).axes[0].child_axes
    figure = plot_curves(in_volts(watts, circuit))
    above, below = figure.axes
    assert above.get_ylabel() == "voltage [V]"
    np.testing.assert_allclose(above.containers[0].lines[0].get_ydata(), [1, 1.05, 1.1])
    figure.draw_without_rendering()
    for ax in (above, below):
        (counts,) = ax.child_axes
        assert counts.get_ylabel() == "counts"
        np.testing.assert_allclose(counts.get_ylim(), 1000 * np.array(ax.get_ylim()))


def experiment(gain, direction=(0, 0, 1.0), **where):
    samples = gain * FORCE[:, None, None] * np.linspace(-1, 1, 3) if direction[0] else gain * FORCE[:, None, None]
    run = Branch(FORCE, samples * np.ones((3, 4, 3)))
    return Experiment("fz", np.array(direction), where, "W", np.arange(1, 4), (run,), rest=np.full((4, 3), 2e-3))


def test_slopes_are_compared_absolute_and_relative():
    figure = plot_sensitivity([experiment(-1e-5, cell="a"), experiment(-3e-5, cell="b")])
    change, percent, slope, relative = figure.axes
    labels = [ax.get_ylabel() for ax in (change, percent, slope, relative)]
    assert labels == [f"{word}, taxel 1 [{unit}]" for word, unit in zip(
        ("change", "change", "slope", "slope"), ("µW", "%", "µW/N", "%/N"), strict=True)]  # fmt: skip
    np.testing.assert_allclose(percent.containers[1].lines[0].get_ydata(), [0, 7.5, 15])
    np.testing.assert_allclose(relative.containers[1].lines[0].get_ydata(), [-1.5, -1.5])
    assert slope.get_xlim() == change.get_xlim() and slope.get_xlim()[0] > slope.get_xlim()[1]


def test_under_a_tangential_load_the_taxel_that_changes_most_is_compared():
    figure = plot_sensitivity([experiment(1e-5, (1.0, 0, 0), nu=number) for number in (0.48, 0.49)])
    assert figure.axes[0].get_ylabel() == "change, taxel 1 [µW]"


def test_slopes_against_a_dimension_in_watts_and_volts():
    watts = [experiment(-1e-5 * size, size=size, reading="W") for size in (1.0, 2.0)]
    volts = [replace(experiment(-3e-3 / size, size=size, reading="V"), unit="V") for size in (1.0, 2.0)]
    assert parameters_of(watts + volts) == ["size"]
    figure = plot_against(watts + volts)
    absolute = figure.axes[::2]
    assert [ax.get_ylabel() for ax in absolute] == ["mean slope by fz [µW/N]", "mean slope by fz [mV/N]"]
    assert [ax.get_title() for ax in absolute] == [f"readings in {unit}, taxel 1" for unit in "WV"]
    np.testing.assert_allclose(absolute[1].containers[0].lines[0].get_xydata(), [[1, -3e-3], [2, -1.5e-3]])


def test_slopes_against_each_dimension():
    grid = [experiment(-1e-5 * size * other, size=size, cell=f"c{other}") for size in (2.0, 1.0) for other in (1, 2, 3)]
    assert parameters_of(grid) == ["size", "cell"] and parameters_of(grid[:1]) == []
    figure = plot_against(grid)
    by_size, _, by_cell, relative = figure.axes
    assert by_size.get_xlabel() == "size" and len(by_size.containers) == 3 and len(by_cell.containers) == 2
    np.testing.assert_allclose(by_size.containers[0].lines[0].get_xydata(), [[1, -1e-5], [2, -2e-5]])
    np.testing.assert_allclose(np.array(relative.containers[0].lines[0].get_ydata(), float), [-1, -2, -3])


@pytest.mark.usefixtures("painted_figures")
def test_a_small_picture_looks_as_the_full_one(tmp_path):
    axes = axes_of((4, 3), 1, 1)
    axes[0, 0].plot([0, 1], [0, 2], label="a line")
    axes[0, 0].figure.savefig(tmp_path / "full.png")
    save_small(axes[0, 0].figure, tmp_path / "small.png")
    small, full = (np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB")) for name in ("small", "full"))
    assert small.shape == full.shape and np.abs(small.astype(int) - full).mean() < 1
    assert (tmp_path / "small.png").stat().st_size < 0.6 * (tmp_path / "full.png").stat().st_size
