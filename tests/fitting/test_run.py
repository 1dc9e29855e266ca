"""Fits through the whole chain find what made the data."""

from __future__ import annotations

import json

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import sweep

CELL = one_cell(scattering="isotropic", fz=0, youngs_modulus=4, mesh_size="$elements", elements=2.5)
SOFT = one_cell(scattering="isotropic", fz=-0.4, youngs_modulus=2, time=0, history="", g=0.2, tau=4.0).replace(
    '<vector name="force"',
    '<string name="prony" value="$g $tau"/> <float name="time" value="$time"/>'
    ' <string name="history" value="$history"/> <vector name="force"',
)
STUDY = """
scene = "cell.xml"
points = 16
[fit]
data = "data.csv"
[fit.unknowns]
youngs_modulus = { start = 3, low = 1, high = 10 }
gain = 100
"""


def test_modulus_and_gain_of_a_cell(taxel, tmp_path):
    """Data of 4.3 MPa and 180 V/W with noise of 0.1 mV, by elements of half the size: 95 % intervals by the data alone
    left the modulus out."""
    (tmp_path / "cell.xml").write_text(CELL)
    (tmp_path / "fit.toml").write_text(STUDY)
    forces = np.array([0.0, -1.5, -3.0])
    study = sweep(tmp_path / "cell.xml", {"fz": forces}, {"youngs_modulus": 4.3, "elements": 1.25}, target_error=0.02)
    volts = 180 * study.power.values[:, 0] + 1e-4 * np.random.default_rng(1).normal(size=3)
    rows = "\n".join(f"{force},{volt:.6f},0.0001" for force, volt in zip(forces, volts, strict=True))
    (tmp_path / "data.csv").write_text(f"fz_N,v1_V,v1_error_V\n{rows}\n")
    done = taxel("fit", "fit.toml", "-o", "out", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    modulus, gain = answer["unknowns"]
    assert 3 * modulus["data_error"] < abs(modulus["value"] - 4.3) < 2 * modulus["error"] < 1.5
    assert abs(gain["value"] - 180) < 2 * gain["error"] < 8
    for unknown in (modulus, gain):
        parts = [unknown[f"{source}_error"] for source in ("data", "light", "mechanics", "geometry")]
        assert unknown["error"] == pytest.approx(np.linalg.norm(parts))
        assert unknown["high"] - unknown["value"] == pytest.approx(1.96 * unknown["error"], rel=1e-3)
    assert 0.1 < modulus["mechanics_error"] < 1  # elements of 2.5 mm
    (note,) = answer["notes"]
    assert note.startswith("Errors leave out")
    made = {file.name for file in (tmp_path / "out").iterdir()}
    assert made == {"fit.csv", "residuals.csv", "correlation.csv", "notes.txt", "fit.png", "fit.svg"}


def test_a_circuit_under_a_plate(taxel, tmp_path):
    """Without derivatives; the load of the circuit is found beside where the plate is."""
    circuit = "circuit = { supply = 3.3, load_resistance = 1e4, transfer = 0.01 }\n"
    head = (
        'scene = "plate.xml"\npoints = 256\nseed = 1\n[define]\nscattering = "lambertian"\n[fit]\ndata = "data.csv"\n'
    )
    unknowns = "[fit.unknowns]\nz = { start = 0.6, low = 0.3, high = 2 }\n'circuit.load_resistance' = 2e4\n"
    (tmp_path / "fit.toml").write_text(circuit + head + unknowns)
    offsets = [0, 0.5, 1.0, 1.5]
    study = sweep("plate.xml", {"offset_x": offsets}, {"scattering": "lambertian", "z": 0.8}, points=4096, seed=9)
    volts = 1e4 * 0.01 * study.power.values[:, 0]
    (tmp_path / "data.csv").write_text(
        "offset_x,v1_V\n" + "\n".join(f"{x},{v}" for x, v in zip(offsets, volts, strict=True))
    )
    done = taxel("fit", "fit.toml", "-o", "out")
    assert done.returncode == 0, done.stderr
    assert "derivatives with respect to z are differences of noisy readings" in done.stdout
    table = np.genfromtxt(tmp_path / "out" / "fit.csv", delimiter=",", names=True, dtype=None, encoding=None)
    assert table["value"] == pytest.approx([0.8, 1e4], rel=0.02)
    assert np.all(np.abs(table["value"] - [0.8, 1e4]) < 3 * table["error"]) and np.all(table["light_error"] > 0)


def test_a_prony_term_of_a_hold(taxel, tmp_path):
    """Of a pad that creeps under a force: 0.3 of its stress relaxes within 5 s."""
    (tmp_path / "cell.xml").write_text(SOFT)
    times = [0.01, 4, 60]
    steps = {"time": times, "fz": [-0.4] * 3}
    study = sweep(tmp_path / "cell.xml", {}, {"g": 0.3, "tau": 5}, together=steps, points=16)
    power = study.power.values[:, 0]
    assert power[2] > power[1] > power[0]
    rows = "\n".join(f"{time},{watts}" for time, watts in zip(times, power, strict=True))
    (tmp_path / "data.csv").write_text(f"time_s,p1_W\n{rows}\n")
    unknowns = "g = { start = 0.29, low = 0.05, high = 0.8 }\ntau = { start = 4.7, low = 0.5, high = 30 }\n"
    head = 'scene = "cell.xml"\npoints = 16\n[fit]\ndata = "data.csv"\n[fit.unknowns]\n'
    (tmp_path / "fit.toml").write_text(head + unknowns)
    done = taxel("fit", "fit.toml", "-o", "out", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert [unknown["value"] for unknown in answer["unknowns"]] == pytest.approx([0.3, 5.0], rel=5e-3)
    *notes, last = answer["notes"]
    assert len(notes) == 2 and all(note.endswith("(prony); sweep over the load instead.)") for note in notes)
    assert last.startswith("Errors leave out")
