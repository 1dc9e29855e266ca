"""Differences of noisy readings: steps that noise does not hide, and unknowns that it hides, by made-up studies."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.fitting import model as module
from mitsuba_taxel.fitting import run_fit
from mitsuba_taxel.fitting.model import STEP_SHARES

OFFSETS = np.array([0.0, 0.5, 1.0, 1.5])
REPLICATES, TRUTH = 32, 0.8
STUDY = """
scene = "plate.xml"
points = 64
[fit]
data = "data.csv"
[fit.unknowns]
z = { start = 0.6, low = 0.3, high = 2 }
"""


@pytest.fixture
def fitted(tmp_path, monkeypatch, llvm_mono):
    """The result of a fit to readings 1 + z x, whose replicates scatter by ``noise`` anew at each evaluation; and the
    values of z that were evaluated."""

    def fit(noise):
        random, seen = np.random.default_rng(3), []

        def study_of(batch, pool, folder):
            seen.append(float(batch.defines["z"]))
            replicates = 1 + seen[-1] * OFFSETS + noise * random.normal(size=(REPLICATES, 4))
            power, error = replicates.mean(axis=0), replicates.std(axis=0, ddof=1) / math.sqrt(REPLICATES)
            columns = {"power": power, "standard_error": error, "total_error": np.hypot(error, 1e-3)}
            about = {"failures": "", "notes": ""}
            content = {name: (["step", "taxel"], each[:, None]) for name, each in columns.items()}
            content["replicate_power"] = (["replicate", "step", "taxel"], replicates[..., None])
            return xr.Dataset(content, {"taxel": [1]}, about)

        monkeypatch.setattr(module, "run_batch", study_of)
        (tmp_path / "fit.toml").write_text(STUDY)
        rows = "".join(f"{x},{1 + TRUTH * x},0.001\n" for x in OFFSETS)
        (tmp_path / "data.csv").write_text(f"offset_x,p1_W,p1_error_W\n{rows}")
        return run_fit(tmp_path / "fit.toml", tmp_path / "out"), np.array(seen)

    return fit


def steps(seen):
    """Relative steps of differences: of values from one evaluated up to three before."""
    relative = np.concatenate([seen[later:] / seen[:-later] - 1 for later in (1, 2, 3)])
    return {share for share in STEP_SHARES if np.isclose(relative, share, rtol=1e-6).any()}


def test_steps_grow_until_noise_does_not_hide_the_change(fitted):
    """Noise of the readings of 0.5 %: a step of 2 % changes them by as much."""
    result, seen = fitted(0.03)
    row = result.unknowns.iloc[0]
    assert steps(seen) >= {0.02, 0.06} and not any("hides" in line for line in result.warnings)
    # Least squares by hand: of one reading by z, x; the scatter of a mean is noise / sqrt(32).
    expected = 0.03 / math.sqrt(REPLICATES) / math.sqrt((OFFSETS**2).sum())
    assert row.light_error == pytest.approx(expected, rel=0.4)
    assert abs(row.value - TRUTH) < 4 * row.error and row.error > row.light_error > row.data_error
    assert row.mechanics_error == pytest.approx(1e-3 * OFFSETS.sum() / (OFFSETS**2).sum(), rel=0.3)


def test_an_unknown_that_noise_hides_is_not_determined(fitted):
    result, seen = fitted(0.5)
    row = result.unknowns.iloc[0]
    assert steps(seen) == set(STEP_SHARES) and math.isinf(row.error) and math.isinf(row.high)
    assert any("hides the effect of z, whose error is unknown" in line for line in result.warnings)


def test_without_noise_the_first_step_is_enough(fitted):
    result, seen = fitted(0.0)
    assert steps(seen) == {0.02} and result.unknowns.value[0] == pytest.approx(TRUTH, rel=1e-6)
    assert not result.warnings and result.unknowns.light_error[0] == 0
