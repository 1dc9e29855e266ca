"""A ball pressed into a cell beside CalculiX: what the program is given, and that both agree."""

from __future__ import annotations

import csv
import math
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench_peers import peers

from mitsuba_taxel.evidence.peers import pressed_ball
from mitsuba_taxel.evidence.peers.pressed_ball import BALL, MATERIAL, PAD, deck
from mitsuba_taxel.pads import REGIONS, mesh_pad

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")


@pytest.fixture(scope="module")
def mesh():
    return mesh_pad(PAD, 1.6)


@pytest.fixture(scope="module")
def blocks(mesh):
    """Lines of the input, without those of the pad's nodes and elements, by keyword and set."""
    found = {}
    for line in deck(mesh, MATERIAL, BALL, 1.0).splitlines():
        if line.startswith("*"):
            rows = found.setdefault(line, [])
        else:
            rows.append(line.split(","))
    return found


def _numbers(rows, kind):
    return np.array([row[1:] for row in rows], dtype=kind)


def test_facets_of_the_ball_lie_on_it_and_face_the_pad(mesh, blocks):
    points = _numbers(blocks["*NODE, NSET=BALL"], float)
    wedges = _numbers(blocks["*ELEMENT, TYPE=C3D6, ELSET=BALL"], int) - len(mesh.points) - 1
    middle = (*BALL.at, 4.55 + 2.5)
    corners = points[wedges[:, 3:]] - middle
    assert np.abs(np.linalg.norm(corners, axis=2) - 2.5).max() < 4e-4
    assert np.abs(np.linalg.norm(corners.mean(axis=1), axis=1) - 2.5).max() < 4e-4
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fi->f", outwards, corners.mean(axis=1)) > 0).all()
    inside = points[wedges[:, :3]] - middle
    np.testing.assert_allclose(np.linalg.norm(inside, axis=2), 0.9 * 2.5, rtol=1e-12)
    flat = math.pi * (0.8 * 2.5) ** 2  # seen from below, the ball is met to 0.8 of its radius and more
    assert flat < -outwards[:, 2].sum() / 2 < 1.2 * flat


def test_the_sides_of_elements_that_may_be_met_are_the_top(mesh, blocks):
    """The program's sides are nodes 1 2 3, 1 4 2, 2 4 3 and 3 4 1."""
    sides = {"S1": (0, 1, 2), "S2": (0, 3, 1), "S3": (1, 3, 2), "S4": (2, 3, 0)}
    met = {tuple(sorted(mesh.tets[int(n) - 1, sides[s]])) for n, s in blocks["*SURFACE, NAME=TOP, TYPE=ELEMENT"]}
    top = mesh.faces[mesh.face_region == REGIONS["top"]]
    assert met == {tuple(sorted(face[:3])) for face in top}


@needs_ccx
def test_force_and_displacement_agree_with_the_peer(tmp_path, monkeypatch):
    monkeypatch.setattr(pressed_ball, "INCREMENT", 0.25)  # one increment in place of three: as close
    file = tmp_path / "table.csv"
    arguments = ["ball", "--mesh-size", "1.25", "--depth", "0.25", "--csv", str(file)]
    assert CliRunner().invoke(peers, arguments, catch_exceptions=False).exit_code == 0
    with file.open(newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert float(row["force N"]) == pytest.approx(1.15, abs=0.01)
    assert float(row["force difference"].rstrip("%")) < 0.2
    assert float(row["rms difference"].rstrip("%")) < 0.6
    assert float(row["same element"].rstrip("%")) < 0.6
