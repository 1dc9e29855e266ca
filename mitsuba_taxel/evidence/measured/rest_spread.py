"""Spread of the readings of the measured pad at rest, computed from tolerances of its components."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas
import xarray as xr

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import scene_text
from mitsuba_taxel.parts import read_part
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.tolerances import run_tolerance

SAMPLES, POINTS = 64, 256
GAIN = "gain"

_STUDY = """\
scene = "cell.xml"
points = {points}

[tolerance]
samples = {samples}

[tolerance.of]
gain = {{ law = "triangular", low = {low:.6g}, peak = 1, high = {high:.6g} }}
cell_height = {{ law = "normal", mean = {core_height}, sd = 0.05 }}
spacing = {{ law = "normal", mean = {spacing}, sd = 0.03 }}
x = {{ law = "normal", mean = 0, sd = 0.05 }}
y = {{ law = "normal", mean = 0, sd = 0.05 }}
tilt = {{ law = "normal", mean = 0, sd = 1 }}
reflectance = {{ law = "uniform", low = 0.9, high = 1 }}
"""

SOURCES = {
    GAIN: "LED and phototransistor: least, typical and most current of the VCNT2020, by its datasheet",
    "cell_height": "mm, roof above the dies; assumed: cast and seated by hand",
    "spacing": "mm, of the dies; assumed",
    "x": "mm, of the package in its cell; assumed",
    "y": "mm, likewise",
    "tilt": "degrees, of the package about y; assumed",
    "reflectance": "of the roof; assumed",
}
"""Meaning of each parameter, and source of its distribution."""


class Spread(NamedTuple):
    """Spread of the reading at rest, and the contributions to it.

    Attributes
    ----------
    laws, shares : dict[str, str], dict[str, float]
        Distribution, and total Sobol' index, of each parameter.
    all, without_gain : float
        Standard deviation of the reading in percent of its mean, due to all parameters, and due to all except the gain.
    all_error, without_gain_error : float
        Standard errors of these due to the finite number of samples.
    gain : float
        Standard deviation of the gain alone, in percent.
    """

    laws: dict[str, str]
    shares: dict[str, float]
    all: float
    without_gain: float
    all_error: float
    without_gain_error: float
    gain: float

    def gain_for(self, spread: float) -> float:
        """Spread of the gain in percent that is needed, with the other tolerances, for a ``spread`` of readings in
        percent.

        Readings are proportional to the gain; the relative variance of a product follows from the relative variances of
        its factors.
        """
        variance = (1 + (spread / 100) ** 2) / (1 + (self.without_gain / 100) ** 2) - 1
        return 100 * float(np.sqrt(max(variance, 0.0)))


def spread(store: PaperStudies) -> Spread:
    """Spread of the readings at rest: read from the store, or computed if it is missing there."""
    scene, study = _texts()
    request = {"scene": scene, "study": study}
    study_data = store.study("tolerance/rest", request, lambda: _computed(store, scene, study))
    names = study_data.parameter.values.tolist()
    samples = study_data.sample.values
    return Spread(
        dict(zip(names, study_data.law.values.tolist(), strict=True)),
        dict(zip(names, study_data.share.values.tolist(), strict=True)),
        _relative(samples),
        _relative(samples / study_data.gain.values),
        _error(samples),
        _error(samples / study_data.gain.values),
        _relative(study_data.gain.values),
    )


def _relative(values: np.ndarray) -> float:
    return 100 * float(values.std(ddof=1) / values.mean())


def _error(values: np.ndarray) -> float:
    """Standard error of the relative standard deviation that :func:`_relative` computes, by the jackknife (B. Efron and
    C. Stein, 1981)."""
    jackknife = np.array([_relative(np.delete(values, number)) for number in range(len(values))])
    return float(np.sqrt((len(values) - 1) * jackknife.var()))


def _computed(store: PaperStudies, scene: str, study: str) -> xr.Dataset:
    folder = store.folder / "tolerance"
    make_folder(folder)
    write_text(folder / "cell.xml", scene)
    write_text(folder / "study.toml", study)
    result = run_tolerance(folder / "study.toml", folder / "spread")
    shares: pandas.DataFrame = result.shares[result.shares.figure == "rest"].set_index("parameter")
    names = result.parameters.parameter.tolist()
    return xr.Dataset(
        {
            "law": ("parameter", result.parameters.law.tolist()),
            "share": ("parameter", shares.total[names].to_numpy()),
            "sample": ("number", result.samples.rest_1.to_numpy()),
            "gain": ("number", result.samples[GAIN].to_numpy(dtype=float)),
        },
        coords={"parameter": names},
    )


def _texts() -> tuple[str, str]:
    """Contents of the files of the scene and of the study, as text."""
    reflector = read_part("njl5908ar")
    emitter, detector = reflector.emitter, reflector.detector
    lowest, typical, highest = (
        read_part("vcnt2020").electrical[f"collector_current_{level}_A"] for level in ("least", "typical", "most")
    )
    values = {
        "core": measured.CORE,
        "core_height": measured.CORE_HEIGHT,
        "spacing": round(detector.x - emitter.x, 6),
        "middle": round((detector.x + emitter.x) / 2, 6),
        "body": ", ".join(f"{side:g}" for side in reflector.body),
        "below": -reflector.body[2],
        "led": emitter.die_width,
        "width": detector.die_width,
        "depth": detector.die_length,
    }
    study = _STUDY.format(samples=SAMPLES, points=POINTS, low=lowest / typical, high=highest / typical, **values)
    return scene_text("measured_cell").format(**values), study
