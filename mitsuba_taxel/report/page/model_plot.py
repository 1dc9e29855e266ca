"""Plot of an exported model of readings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.plots.figures import MOST_LINES, MOST_PANELS, label_with_prefix, legend_beside, panel_axes, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLACES = 101
"""Values of an input at which the model is evaluated."""


def has_readings(file: Path) -> bool:
    """Whether a model in a file tells readings, as a calibration does not."""
    import onnx

    return "readings" in [output.name for output in onnx.load(file, load_external_data=False).graph.output]


def plot_model(file: Path, narrow: bool = False) -> Figure:
    """Readings of the taxels against each input of a model, with the others in the middle of their ranges. Of many
    taxels, those whose reading changes most.

    Parameters
    ----------
    file : Path
        Of a model that ``export`` wrote.
    narrow : bool
        Whether the picture is for a phone.
    """
    import onnx
    from onnx.reference import ReferenceEvaluator

    model = onnx.load(file, load_external_data=False)
    about = {entry.key: entry.value for entry in model.metadata_props}
    names, units, low, high = (json.loads(about[key]) for key in ("inputs", "units", "low", "high"))
    run, middle = ReferenceEvaluator(model), (np.array(low) + high) / 2
    varied = [number for number in range(len(names)) if high[number] > low[number]][:MOST_PANELS]
    lines = []
    for number in varied:
        inputs = np.tile(middle, (PLACES, 1))
        inputs[:, number] = np.linspace(low[number], high[number], PLACES)
        (readings,) = run.run(["readings"], {"inputs": inputs})
        lines.append((inputs[:, number], np.asarray(readings)))
    change = np.max([np.ptp(readings, axis=0) for _, readings in lines], axis=0)
    shown = np.sort(np.argsort(-change, kind="stable")[:MOST_LINES])
    axes = panel_axes(1, len(varied), size=(4.6, 3.2), sharex=False, narrow=narrow)
    for ax, number, (x, readings) in zip(axes.flat, varied, lines, strict=True):
        for place, taxel in enumerate(shown.tolist()):
            look: dict[str, Any] = {**style(place), "marker": ""}
            ax.plot(x, readings[:, taxel], label=str(taxel + 1), linewidth=1.2, **look)
        ax.set_xlabel(f"{names[number]} [{units[number]}]" if units[number] not in ("", "1") else names[number])
    label_with_prefix(axes.flat, "optical power", "W")
    legend_beside(axes.flat[0].figure, axes.flat, "taxel")
    return axes.flat[0].figure
