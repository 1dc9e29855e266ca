"""Dies and resin from curves of current over distance: known ones are found again, within their intervals."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from taxel_program import run_program

from mitsuba_taxel import InputError
from mitsuba_taxel.fitting import fit_part, write_part
from mitsuba_taxel.fitting.part.part_fit import part_unknowns
from mitsuba_taxel.parts import card_curve, mirror_curve, read_datasheet, read_part

HEIGHTS = np.array([0.2, 0.35, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
FILE = """title = "mine"
source = "a drawing"
body = [2.6, 2.0, 0.8]
wavelength = 940
resin_index = {index}
distance_reflector = "{reflector}"
[emitter]
x = -0.6
window_width = 0.9
window_length = 1.6
die_width = {emitter}
die_length = {emitter}
die_depth = {depth}
[detector]
x = 0.6
window_width = 0.9
window_length = 1.6
die_width = {detector}
die_length = {detector}
die_depth = {depth}
"""
UNKNOWN = '"unknown"'
TRUTH = {"emitter": 0.3, "detector": 0.5, "depth": 0.15, "index": 1.5}


def part_file(folder, name="part.toml", reflector="mirror", **numbers):
    file = folder / name
    file.write_text(FILE.format(reflector=reflector, **{**TRUTH, **numbers}))
    return file


def curve_file(folder, noise=0.0, seed=0, reflector="mirror"):
    """Currents of the truth in mA with normal noise, relative to the largest; none below 0."""
    truth = read_part(part_file(folder, "truth.toml"))
    power = (card_curve if reflector == "white card" else mirror_curve)(truth, HEIGHTS)
    power *= 1.7 / power.max()
    power += np.random.default_rng(seed).normal(0, noise * power.max(), len(power))
    file = folder / "curve.csv"
    rows = "".join(f"{height},{max(current, 0)!r}\n" for height, current in zip(HEIGHTS, power.tolist(), strict=True))
    file.write_text("distance [mm],current [mA]\n" + rows)
    return file


def test_the_depth_of_dies_is_found_again_without_noise(tmp_path):
    fit = fit_part(curve_file(tmp_path), part_file(tmp_path, depth=UNKNOWN, detector=UNKNOWN))
    found = {unknown.name: unknown for unknown in fit.unknowns}
    assert list(found) == ["detector's die", "depth"]
    assert found["depth"].value == pytest.approx(0.15, abs=5e-3) and found["depth"].determined
    assert found["detector's die"].value == pytest.approx(0.5, abs=0.03)
    assert fit.rms < 1e-3 and fit.part.detector.die_length == fit.part.detector.die_width
    assert fit.part.emitter.die_depth == fit.part.detector.die_depth == found["depth"].value


def test_intervals_of_95_percent_hold_in_as_many_curves(tmp_path):
    """50 curves with 1 % noise; a false alarm in 2000 runs, as the count is binomial."""
    assert sum(covered(tmp_path, seed) for seed in range(50)) >= binom.ppf(5e-4, 50, 0.95)


def covered(folder, seed, noise=0.01):
    """Whether the interval of the depth contains the truth."""
    (depth,) = fit_part(curve_file(folder, noise, seed), part_file(folder, depth=UNKNOWN)).unknowns
    return depth.interval[0] <= TRUTH["depth"] <= depth.interval[1]


def test_a_white_card_is_another_curve(tmp_path):
    fit = fit_part(
        curve_file(tmp_path, reflector="white card"), part_file(tmp_path, reflector="white card", depth=UNKNOWN)
    )
    assert fit.unknowns[0].value == pytest.approx(0.15, abs=0.01)


def test_unknowns_and_their_ranges(tmp_path):
    every = part_unknowns(read_datasheet(part_file(tmp_path)))
    assert [u.name for u in every] == ["emitter's die", "detector's die", "depth", "resin_index"]
    assert every[0].high == 0.9 and every[2].high == pytest.approx(0.72)
    some = part_unknowns(read_datasheet(part_file(tmp_path, index=UNKNOWN)))
    assert [u.entries for u in some] == [("resin_index",)]
    with pytest.raises(InputError, match="emitter.window_width, emitter.x cannot be fitted"):
        part_unknowns(read_datasheet("tcrt5000"))
    with pytest.raises(InputError, match="has 5 rows: at least 6 are needed for 4 unknowns"):
        (tmp_path / "short.csv").write_text("d [mm],i\n" + "".join(f"{z},{1 / z}\n" for z in (1, 2, 3, 4, 5)))
        fit_part(tmp_path / "short.csv", part_file(tmp_path))


def test_the_file_is_a_part_with_the_curve_and_its_sources(tmp_path):
    fit = fit_part(curve_file(tmp_path), part_file(tmp_path, depth=UNKNOWN))
    write_part(fit, tmp_path / "fitted.toml")
    part = read_part(tmp_path / "fitted.toml")
    assert part.emitter.die_depth == pytest.approx(fit.unknowns[0].value, rel=1e-4)
    assert "fitted to curve.csv by `taxel fit`, 95 % interval" in part.sources["detector.die_depth"]
    rows = np.array(part.distance_curve)
    np.testing.assert_allclose(rows[:, 0], HEIGHTS)
    curve = mirror_curve(part, HEIGHTS)
    np.testing.assert_allclose(curve / curve.max(), rows[:, 1], atol=2e-3)
    assert replace(part, name="x").title == "mine"


@pytest.mark.usefixtures("painted_figures")
def test_the_program(tmp_path):
    curve_file(tmp_path, 0.01)
    part_file(tmp_path, depth=UNKNOWN)
    done = run_program(tmp_path, "fit", "curve.csv", "--part", "part.toml", "-o", "out", "--json")
    answer = json.loads(done.stdout)
    depth = answer["unknowns"]["depth"]
    assert depth["low"] <= 0.15 <= depth["high"] and depth["determined"]
    assert (tmp_path / "out" / "part.toml").is_file() and (tmp_path / "out" / "part.png").stat().st_size
    for words, said in (
        (("fit", "curve.csv", "-o", "out"), "name the part that it was measured with by --part"),
        (("fit", "study.toml", "--zero", "1", "-o", "out"), "--zero is not allowed without --part"),
        (("fit", "curve.csv", "--part", "tcrt5000", "-o", "none"), "cannot be fitted"),
    ):
        refused = run_program(tmp_path, *words)
        assert refused.returncode == 2 and said in refused.stderr and refused.stderr.count("\n") == 1
    assert not (tmp_path / "none").exists()
