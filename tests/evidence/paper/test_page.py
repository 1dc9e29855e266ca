"""The page, from studies with known numbers."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.evidence.paper import loading, paper, plate
from mitsuba_taxel.evidence.paper.analysis import (
    PUBLISHED,
    against_table_one,
    expected_of_counting,
    explanations,
    nonlinearity_of,
    readings,
    skewness,
    table_one,
)
from mitsuba_taxel.evidence.paper.page.page import SECTIONS, write_page
from mitsuba_taxel.evidence.paper.slopes import Sensitivity
from mitsuba_taxel.evidence.paper.variations import choices

NORMAL = {"parallelepiped": 40e-6, "cylindrical": 30e-6, "spherical": 20e-6, "hemispheric": 10e-6}
"""Slopes in W/N; the readings at rest are in the ratio of the squares of the paper's numbers."""
NOISE = 2e-6
TILT = np.array([-1, 0, 1, -1, 0, 1, -1, 0, 1]) + np.array([1, 1, 1, 0, 0, 0, -1, -1, -1])


def at_rest(cell: str) -> float:
    return 0.01 * (paper.NORMAL[cell] / paper.NORMAL["hemispheric"]) ** 2


@pytest.fixture(scope="module")
def nominal(make_study):
    """Straight lines: each taxel rises with the normal force, and by its place with a tangential one."""
    studies = {}
    for number, cell in enumerate(paper.CELLS):
        fz = np.array([0.0, -10.0, -20.0])
        force = np.array([0.0, 4.0, 9.0])
        normal = np.repeat(at_rest(cell) - NORMAL[cell] * fz[:, None], 9, axis=1)
        tangential = at_rest(cell) + 8 * NORMAL[cell] + 0.5 * NORMAL[cell] * force[:, None] * TILT
        slope, tilted = np.full(normal.shape, -NORMAL[cell]), np.repeat([0.5 * NORMAL[cell] * TILT], 3, axis=0)
        studies[cell] = {"fz": make_study({"fz": fz}, normal, NOISE, number, slope)}
        for path in loading.PATHS[1:]:
            failures = f"{path}=9: gone"
            studies[cell][path] = make_study({path: force}, tangential, NOISE, 10 + number, tilted, failures=failures)
    return studies


@pytest.fixture(scope="module")
def found(make_study, nominal):
    """Every part of a rerun."""
    z, spacings = np.arange(0.02, 2.5, 0.1), np.array(plate.PEAK_SPACINGS)
    laws = list(plate.LAWS)

    def bell(height: np.ndarray, top: np.ndarray) -> np.ndarray:
        return 0.01 * np.exp(-((np.log(height / top) / 0.9) ** 2))

    heights = np.repeat(bell(z, 0.3)[:, None, None], 3, axis=1)
    distances = np.linspace(0, 1.5, 7)
    edge = np.repeat(np.linspace(0.01, 0, 7)[:, None, None], 3, axis=1)
    peak_z = np.array(plate.PEAK_HEIGHTS)
    tops = spacings[:, None] / np.array([3.0, 2.4, 2.0])
    around = bell(peak_z[:, None, None], tops)[..., None]

    def edges(axis: str) -> xr.Dataset:
        study = make_study({f"offset_{axis}": distances, "law": laws}, edge, 1e-5)
        return study.assign_coords(edge=(f"offset_{axis}", distances))

    def coarse(cell: str, factor: float, seed: int) -> dict[str, xr.Dataset]:
        fz, force = np.array([0.0, -10.0, -20.0]), np.array([0.0, 4.0, 8.0])
        tangential = {
            path: at_rest(cell) + factor * NORMAL[cell] * force[:, None] * TILT[[2, 4]] for path in ("fx", "fy")
        }
        normal = np.repeat(at_rest(cell) - factor * NORMAL[cell] * fz[:, None], 2, axis=1)
        return {"fz": make_study({"fz": fz}, normal, NOISE, seed)} | {
            path: make_study({path: force}, power, NOISE, seed + 1) for path, power in tangential.items()
        }

    counts = np.random.default_rng(2)
    fz = np.arange(0, -20.5, -0.5)
    return {
        "fig4": {spacing: make_study({"z": z, "law": laws}, heights, 1e-5) for spacing in plate.SPACINGS},
        "fig5": {spacing: edges("x") for spacing in plate.SPACINGS},
        "fig6": {spacing: edges("y") for spacing in plate.SPACINGS},
        "peak": make_study({"z": peak_z, "spacing": spacings, "law": laws}, around, 1e-5),
        "nominal": nominal,
        "roofs": {
            cell: xr.Dataset({name: ("taxel", size * TILT) for name, size in (("normal", 0.0), ("diagonal", -0.01))})
            for cell in paper.CELLS
        },
        "beyond": {cell: {path: nominal[cell][path] for path in loading.PATHS[1:]} for cell in paper.CELLS},
        "variations": {
            choice.words: {cell: coarse(cell, 1 + 0.1 * number, number) for cell in paper.CELLS}
            for number, choice in enumerate(choices())
        },
        "analog": {
            cell: xr.Dataset(
                {"power": (["fz", "replicate"], counts.binomial(65536, at_rest(cell), (41, 96)) / 65536)}, {"fz": fz}
            )
            for cell in paper.CELLS
        },
    }


@pytest.fixture
def small_figures(painted_figures, monkeypatch):
    """Figures are painted with few pixels, as none are looked at."""
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 20)


def cells_of(page: str, first: str) -> list[list[str]]:
    """Cells of the rows of all tables that begin with ``first``."""
    rows = re.findall(rf"^\| {re.escape(first)} \| (.*) \|$", page, flags=re.M)
    return [row.split(" | ") for row in rows]


def holds(cell: str, expected: float) -> bool:
    """Whether a value with its error, as the page has it, is within four errors and 10 % of the expected one."""
    value, error, power = re.fullmatch(r"\(?(-?[\d.]+) ± ([\d.]+)\)?(?:e([-+]\d+))?", cell).groups(default="0")
    difference = abs(float(value) * 10 ** int(power) - expected)
    return difference < 4 * float(error) * 10 ** int(power) + 1e-12 and difference < 0.1 * abs(expected)


@pytest.mark.usefixtures("small_figures")
def test_choices_without_results_are_named(found, tmp_path):
    some = {words: cells for words, cells in found["variations"].items() if "mirror" not in words}
    page = write_page({"variations": some}, tmp_path, "it").read_text(encoding="utf-8")
    missing = "mirror roof; mirror roof, LED uniform_polar_angle; mirror roof, LED lambertian"
    words = " ".join(page.split())
    assert f"{len(some)} of {len(some) + 3} choices and pairs are computed. Not computed: {missing}." in words
    assert "Single choices" in page and "mirror roof (" not in page


@pytest.mark.usefixtures("small_figures")
def test_the_whole_page(found, tmp_path):
    page = write_page(found, tmp_path, "taxel reproduce -o DIR --docs docs").read_text(encoding="utf-8")
    pictures = re.findall(r"\]\((paper/\w+\.png)\)", page)
    assert len(pictures) == 10
    for picture in pictures:
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert "nan" not in page
    for cell in paper.CELLS:
        normal, tangential = (row for row in cells_of(page, cell) if row[0] in ("normal", "tangential"))
        assert float(normal[1]) == 1e6 * paper.NORMAL[cell]
        assert holds(normal[2], 1e6 * NORMAL[cell])
        assert holds(normal[3], NORMAL[cell] / paper.NORMAL[cell])
        assert holds(normal[4], -1e6 * NORMAL[cell])
        assert holds(tangential[2], 1e6 * NORMAL[cell])
    for law, spacing in zip(plate.LAWS, (0.9, 0.72, 0.6), strict=True):
        assert holds(cells_of(page, f"`{law}`")[0][-1], spacing)
    assert "here parallelepiped > cylindrical > spherical > hemispheric (probability 1.000" in page
    assert "2 of 6 pairs of shapes come in the same order" in page
    assert "took 48 s, summed over their studies" in page  # 16 studies of 3 s
    assert "parallelepiped, along x: fx=9: gone" in page


def test_only_parts_that_are_there_are_shown(found, tmp_path):
    page = write_page({"nominal": found["nominal"]}, tmp_path, "").read_text(encoding="utf-8")
    assert "Table 1" in page and "Fig. 4" not in page and "unstated" not in page
    assert len({id(section) for _, section in SECTIONS}) == len(SECTIONS)


def test_numbers_that_go_with_the_square_root_are_recognised(nominal):
    table, counts = table_one(nominal), expected_of_counting(nominal)
    fits = explanations(paper.NORMAL, table["normal"], counts["normal"], readings(nominal)["normal"])
    assert fits["square root of the reading"].misfit == pytest.approx(1, abs=1e-3)
    assert fits["square root of the reading"].p > 0.999
    assert fits["maximum slope with counting noise"].p > 0.5
    assert fits["true maximum slope"].p < 1e-6


def test_the_factor_of_table_one_does_not_depend_on_the_errors():
    """Numbers that are twice ours for one force and 18 times for the other are 6 times on average, and 3 off."""
    times = {"normal": 2.0, "tangential": 18.0}

    def one(kind: str, number: int, cell: str) -> Sensitivity:
        slope = PUBLISHED[kind][cell] / times[kind]
        return Sensitivity(slope, slope * 10.0**-number, 0.0, 1, slope, 0.0)

    table = {kind: {cell: one(kind, number, cell) for number, cell in enumerate(paper.CELLS, 1)} for kind in times}
    fit = against_table_one(table)
    assert (fit.scale, fit.misfit) == pytest.approx((6, 3))


def test_table_one_takes_the_steeper_direction(nominal, make_study):
    force = np.arange(0, 9.0)
    slope = np.repeat([3e-4 * TILT], len(force), axis=0)
    steep = make_study({"fy": force}, 0.01 + 3e-4 * force[:, None] * TILT, NOISE, 0, slope)
    table = table_one({"spherical": {**nominal["spherical"], "fy": steep}})
    assert table["tangential"]["spherical"] == table["fy"]["spherical"]
    assert table["tangential"]["spherical"].max_slope == pytest.approx(6e-4, rel=0.01)


def test_skewness_along_the_diagonal(nominal):
    parts = skewness(nominal["parallelepiped"]["resultant"])
    step = 0.5 * NORMAL["parallelepiped"] * paper.SHOWN_TANGENTIAL_FORCE
    for found, expected in zip(parts.values(), (4 * step, 2 * step, 0), strict=True):
        assert abs(found.value - expected) < 4 * found.error < 1e-4


@pytest.mark.parametrize("bend", [0.0, 0.02, -0.01])
def test_nonlinearity_of_a_parabola(make_study, bend):
    """F (1 + bend F) is furthest from its end-point line in the middle, by bend 10 / (4 (1 + 10 bend)) of the end."""
    force, taxels = np.array([0.0, 8.0, 20.0]), np.array([1.0, 0.5])
    power = 0.01 + 4e-5 * (force * (1 + bend * force))[:, None] * taxels
    slope = -4e-5 * (1 + 2 * bend * force)[:, None] * taxels
    percent, error = nonlinearity_of(make_study({"fz": -force}, power, 1e-6, 0, slope))
    assert percent == pytest.approx(abs(100 * bend * 10 / (4 * (1 + 10 * bend))), abs=1e-3)
    assert error == pytest.approx(100 * 1e-9 * 10 / 4 / (4e-4 * (1 + 10 * bend)), rel=1e-3)
