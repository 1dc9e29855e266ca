"""Synthetic tests of silicones."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.fitting.material.candidates import CANDIDATES
from mitsuba_taxel.fitting.material.curves import StressCurve

LAWS = {candidate.label: candidate for candidate in CANDIDATES}


@pytest.fixture
def stress_of():
    """A function that gives the nominal stress of a law by its label, in a mode, at nominal strains."""

    def stress_of(label, constants, mode, strain):
        return LAWS[label].stress(mode, 1 + np.asarray(strain, dtype=float), np.array(constants, dtype=float))

    return stress_of


@pytest.fixture
def curve_of(stress_of):
    """A function that gives a curve with noise, relative to each stress or to the largest."""

    def curve_of(label, constants, mode, strain, rng, noise=0.05, grows=True):
        stress = stress_of(label, constants, mode, strain)
        deviation = noise * (np.abs(stress) if grows else np.abs(stress).max())
        stress = stress + deviation * rng.normal(size=len(strain))
        return StressCurve(f"{mode}.csv", mode, np.arange(2, len(strain) + 2), np.asarray(strain), stress)

    return curve_of


@pytest.fixture
def write_csv(tmp_path):
    """A function that writes a table and gives its path."""

    def write_csv(name, heading, *columns):
        rows = "".join(",".join(f"{value:.9g}" for value in row) + "\n" for row in zip(*columns, strict=True))
        (tmp_path / name).write_text(f"{heading}\n{rows}")
        return tmp_path / name

    return write_csv
