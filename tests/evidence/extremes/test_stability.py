"""The table of extremes: rows that are right, rows that end, processes that die, and what is said of each."""

from __future__ import annotations

import csv
import json
import math
import os
import pickle
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from started_process import interrupted, started

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.extremes import stability
from mitsuba_taxel.evidence.extremes.case import ExtremeCase, cutbacks, failure_of, mean_roof, node_jacobian
from mitsuba_taxel.evidence.extremes.cases import stability_cases
from mitsuba_taxel.evidence.extremes.slivers import FLATNESS, SliverPad
from mitsuba_taxel.evidence.extremes.solid_cases import solid_cases
from mitsuba_taxel.evidence.extremes.stability import check
from mitsuba_taxel.evidence.extremes.tables import write_csv, write_markdown
from mitsuba_taxel.evidence.rows import isolated_process
from mitsuba_taxel.evidence.rows.row import MechanicsRow, cells, headings
from mitsuba_taxel.evidence.rows.row_files import chosen
from mitsuba_taxel.geometry.element_maps import worst_element
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Node
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.pads import REGIONS, Pad

ONE_CELL = Pad(rows=1, columns=1)
SMALL = ExtremeCase("small", ONE_CELL, value=(0.0, 0.0, -1.0), mesh_size=2.0, with_finer_mesh=True)
SOFT = replace(SMALL, name="soft", material=NeoHookean(0.05), value=(0.0, 0.0, -20.0))
RIGHT = MechanicsRow("a", "converged", "", 4, 2, 0, 0.9, 0.8, 1e-12, 1e-8, "stable", 0.1, 0.02, 0.01, 1.0, 200.0)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def cases(monkeypatch):
    """A function that puts other cases in place of the tables'."""

    def put(*cases):
        monkeypatch.setattr(stability, "stability_cases", lambda: list(cases))
        monkeypatch.setattr(stability, "solid_cases", list)
        monkeypatch.setattr(stability, "reading_cases", list)
        monkeypatch.setattr(stability, "circuit_cases", list)

    return put


@pytest.fixture
def worker(tmp_path, monkeypatch):
    """A function that puts a program in place of the worker."""
    python = sys.executable

    def write(program: str):
        script = tmp_path / f"worker{len(list(tmp_path.glob('worker*')))}"
        script.write_text(f"#!{python}\nimport ctypes, os, sys, time\n{program}")
        script.chmod(0o755)
        monkeypatch.setattr(isolated_process.sys, "executable", str(script))

    return write


def test_a_case_that_converges_has_every_number():
    row = isolated_process.measure_isolated(SMALL)
    assert (row.verdict, row.wrong, row.stability) == ("converged", "", "stable")
    assert row.steps == 1 and row.cutbacks == 0 and 1 <= row.iterations <= 6
    assert 0.5 < row.node_jacobian <= 1 and 0.5 < row.min_jacobian <= 1
    assert row.residual < 1e-9 and row.imbalance < 1e-3
    assert 0 < row.finer_change < 2 * row.stated_error < 1
    assert 100 < row.megabytes < 2000 and 0 < row.seconds < 300


def test_the_roof_moves_as_the_load_and_the_modulus_say():
    soft, stiff = (
        replace(SMALL, material=NeoHookean(modulus), value=(0.0, 0.0, -0.1 * modulus), with_finer_mesh=False).measured()
        for modulus in (0.05, 1000.0)
    )
    assert soft.roof == pytest.approx(stiff.roof, rel=1e-9)
    assert soft.steps == stiff.steps and soft.stated_error == pytest.approx(stiff.stated_error, rel=1e-6)


def test_a_path_that_ends_says_where_and_why():
    row = SOFT.measured()
    found = re.fullmatch(r"ends at \(0, 0, (-[\d.]+)\) N: (touches|cannot be loaded further).*", row.verdict)
    assert found and -20 < float(found[1]) < 0 and row.wrong == ""
    assert row.node_jacobian > 0 and row.steps >= 1 and row.roof > 0
    assert math.isnan(row.finer_change)


def test_one_newton_solve_is_one_step_or_refused():
    row = replace(SMALL, in_one_step=True).measured()
    along = replace(SMALL, with_finer_mesh=False).measured()
    assert (row.verdict, row.steps, row.cutbacks) == ("converged", 1, 0)
    assert row.roof == pytest.approx(along.roof, rel=1e-4)
    refused = replace(SOFT, in_one_step=True, refused=True).measured()
    assert refused.verdict.startswith("refused: ") and refused.wrong == "" and math.isnan(refused.roof)


def test_a_pad_without_a_mesh_is_refused(monkeypatch):
    def failing(self, size, of_origin):
        raise ComputationError("meshing the pad failed: so it is.")

    monkeypatch.setattr(Pad, "mesh", failing)
    row = replace(SMALL, mesh_size=1.9).measured()
    assert row.verdict == "refused: meshing the pad failed: so it is." and row.wrong == "it should not be refused"


@pytest.mark.parametrize(
    ("program", "verdict"),
    [
        ("ctypes.string_at(0)", r"died: signal 11 \(SIGSEGV\)"),
        ("os.kill(os.getpid(), 9)", r"died: signal 9 \(SIGKILL\)"),
        ("raise MemoryError", "out of memory"),
        ("sys.stderr.write(\"terminate called\\n  what():  std::bad_alloc\\n\"); os.abort()", "out of memory"),
        ("raise KeyError('no such thing')", "died: KeyError: 'no such thing'"),
        ("time.sleep(60)", "out of time after 0.8 s"),
    ],
)  # fmt: skip
def test_a_process_that_ends_badly_is_a_row_that_says_so(worker, program, verdict):
    worker(program)
    row = isolated_process.measure_isolated(SMALL, seconds=0.8 if "sleep" in program else 60)
    assert re.fullmatch(verdict, row.verdict) and row.wrong == "no answer" and row.case == "small"
    with pytest.raises(ComputationError, match="^1 of 2 rows are wrong: small.$"):
        check([RIGHT, row])


def test_memory_beyond_the_limit_is_refused_to_the_process():
    row = isolated_process.measure_isolated(SMALL, memory=2**26)
    assert row.wrong == "no answer" and re.match("out of memory|died: ", row.verdict)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({}, ""),
        ({"roof": math.nan}, "not a number"),
        ({"min_jacobian": math.nan}, "not a number"),
        ({"min_jacobian": 0.0}, "elements inverted from the last state on"),
        ({"node_jacobian": -0.25}, "elements inverted from the last state on"),
        ({"inverted": "(8, 0, -8) N"}, "elements inverted from (8, 0, -8) N on"),
        ({"residual": 2e-9}, "out of balance"),
        ({"imbalance": 0.02}, "out of balance"),
        ({"finer_change": 0.05}, "the stated error is too small"),
        ({"finer_change": 0.03}, ""),
        ({"stated_error": math.nan}, ""),
        ({"verdict": "refused: no", "roof": math.nan, "min_jacobian": math.nan}, "it should not be refused"),
    ],
)
def test_what_is_wrong_with_a_row_is_seen(change, what):
    row = replace(RIGHT, **change)
    assert failure_of(row) == what
    refused = row.verdict.startswith("refused")
    assert failure_of(row, refused=True) == ("" if refused else "it should be refused")
    assert cells(replace(row, wrong=what))[1] == row.verdict + (f"; WRONG: {what}" if what else "")


def _segment(positions, limit=math.inf):
    segment = LoadSegment(np.zeros(1), np.ones(1), 2.0, judged=True)
    segment.nodes = [Node(2.0 * p / TICKS, np.zeros(1), np.zeros(1), 1.0, 0.0, 1, True, 0.0) for p in positions]
    segment.limit = limit
    return segment


@pytest.mark.parametrize(
    ("positions", "limit", "count"),
    [
        ([0, 64, 128], math.inf, 0),
        ([0, 64, 96, 128, 192], math.inf, 1),
        ([0, 16, 32, 64], math.inf, 2),
        ([0, 64], 2.0, 7),  # 64, 32, 16, 8, 4, 2, 1 ticks
        ([0, 64, 96], 3.0, 7),  # 64; then 32, 16, 8, 4, 2, 1
        ([0, 64, 128], 3.5, 0),  # a contact before the last node
        ([], math.inf, 0),
    ],
)
def test_cutbacks_are_read_from_the_nodes(positions, limit, count):
    assert cutbacks(_segment(positions, limit)) == count


def test_jacobian_and_roof_of_a_homogeneous_state():
    mesh = ONE_CELL.mesh(2.0)
    gradient = np.array([[0.1, 0.02, 0.0], [0.0, -0.2, 0.03], [0.0, 0.0, 0.05]])
    displacement = mesh.points @ gradient.T
    assert node_jacobian(mesh, displacement) == pytest.approx(np.linalg.det(np.eye(3) + gradient), rel=1e-9)
    height = ONE_CELL.cell_height
    assert mean_roof(mesh, displacement) == pytest.approx(gradient @ [0.0, 0.0, height], abs=1e-12)
    inner = np.setdiff1d(np.arange(mesh.corner_count), mesh.faces)[0]
    displacement[inner] += 4.0
    assert node_jacobian(mesh, displacement) < 0


def test_a_foot_may_be_inverted_where_its_law_is_linear():
    mesh = ONE_CELL.mesh(2.0)
    foot = np.argmin(mesh.points.sum(axis=1))
    displacement = np.zeros_like(mesh.points)
    displacement[foot] = (1.5, 1.5, 0.5)
    assert node_jacobian(mesh, displacement) < 0
    at_foot = np.repeat((mesh.tets == foot).any(axis=1)[:, None], 8, axis=1)
    assert node_jacobian(mesh, displacement, at_foot) == pytest.approx(1.0)


@pytest.mark.parametrize("cell", ["parallelepiped", "hemispheric"])
def test_slivers_are_flat_and_not_inverted(cell):
    pad = SliverPad(cell, rows=1, columns=1)
    before, mesh = Pad.mesh(pad, 1.4), pad.mesh(1.4)
    volume, old = (
        np.linalg.det(m.points[m.tets[:, 1:4]] - m.points[m.tets[:, :1]]) for m in (mesh, before)
    )  # fmt: skip
    assert (volume / old).min() == pytest.approx(FLATNESS, rel=1e-6) and np.sum(volume < 0.011 * old) > 3
    assert volume.sum() == pytest.approx(old.sum(), rel=1e-12) and worst_element(mesh)[0] > 0
    on_surface = np.unique(mesh.faces)
    assert np.array_equal(mesh.points[on_surface], before.points[on_surface])
    assert {REGIONS["roof"], REGIONS["side"]} <= set(mesh.face_region)


def test_an_open_body_is_refused_by_the_name_of_its_file_alone():
    (case,) = (case for case in solid_cases() if case.refused)
    row = pickle.loads(pickle.dumps(case)).measured()
    assert row.wrong == "" and re.match(
        "refused: indenter_file = body.stl is not allowed: its surface is open", row.verdict
    )
    assert replace(case, refused=False).measured().wrong == "it should not be refused"


def test_names_are_unique_and_choose_cases():
    cases = [*stability_cases(), *solid_cases()]
    assert len({case.name for case in cases}) == len(cases) > 45
    assert [case.name for case in chosen(cases, "nu = 0.5, -20")] == ["nu = 0.5, -20 N"]
    assert len(chosen(cases, "*, 40 N along x at")) == 4
    with pytest.raises(InputError, match="^only = 'nothing' is not allowed: "):
        chosen(cases, "nothing")


def test_files_hold_the_rows_so_far(cases, worker, tmp_path):
    cases(SMALL, replace(SMALL, name="small | again"))
    worker(f"print({json.dumps(vars(replace(RIGHT, case='small | again')))!r})")
    rows = stability.stability(csv=tmp_path / "t.csv", markdown=tmp_path / "t.md")
    for count in (1, 2):
        next(rows)
        with (tmp_path / "t.csv").open(newline="") as stream:
            written = list(csv.DictReader(stream))
        page = (tmp_path / "t.md").read_text()
        assert len(written) == count and float(written[0]["roof"]) > 0
        assert f"`taxel bench stability --markdown {tmp_path / 't.md'}`" in page
        table = [line for line in page.splitlines() if line.startswith("|")]
        assert len(table) == 2 + count and (count == 1 or r"small \| again" in table[-1])


def test_tables_round_trip(tmp_path):
    write_csv([RIGHT, MechanicsRow("b", "out of memory", wrong="no answer")], tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as stream:
        first, second = csv.DictReader(stream)
    assert float(first["residual"]) == RIGHT.residual and second["roof"] == "nan" and second["wrong"] == "no answer"
    write_markdown([RIGHT], tmp_path / "t.md", "taxel bench stability", "All cases are measured.")
    (heading, _, line) = [line for line in (tmp_path / "t.md").read_text().splitlines() if line.startswith("|")]
    assert heading.strip("| ").split(" | ") == headings(MechanicsRow)
    assert line.strip("| ").split(" | ")[:5] == ["a", "converged", "4", "2", "0"]


def test_the_command_shows_the_rows_and_fails_on_wrong_ones(cases, worker, monkeypatch):
    import taxel_cli
    from taxel_cli.evidence.bench import command

    assert "bench" in taxel_cli.COMMANDS
    cases(SMALL, replace(SMALL, name="other"))
    answer = json.dumps(vars(replace(RIGHT, case="small")))
    worker(f"print({answer!r})")
    done = CliRunner().invoke(command, ["stability", "--only", "sm?ll"])
    assert done.exit_code == 0 and "1/1 small: converged" in done.stderr
    assert done.stdout.splitlines()[1].split()[:4] == ["small", "converged", "4", "2"]
    worker("os.kill(os.getpid(), 11)")
    done = CliRunner().invoke(command, ["stability"])
    assert isinstance(done.exception, ComputationError) and done.stdout.count("SIGSEGV") == 2


def test_an_interrupt_leaves_what_was_done(tmp_path):
    code = """
import sys, time, taxel_cli
from mitsuba_taxel.evidence.extremes import stability
from mitsuba_taxel.evidence.rows.row import MechanicsRow
stability.measure_isolated = lambda case: MechanicsRow(case.name, "converged") if "x 1" in case.name else time.sleep(60)
sys.argv = ["taxel", "bench", "stability", "--only", "? x ? cells, -", "--csv", "t.csv", "--markdown", "t.md"]
taxel_cli.main()
"""
    command = [sys.executable, "-c", code]
    with started(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE) as running:
        assert running.stderr is not None
        seen = b""
        while b"2/" not in seen:
            seen += os.read(running.stderr.fileno(), 1000) or pytest.fail(seen.decode())
        out, err = interrupted(running)
    assert running.returncode == 130 and b"interrupted" in err
    assert [line.split()[:3] for line in out.decode().splitlines()[1:]] == [["1", "x", "1"]]
    assert (
        len((tmp_path / "t.csv").read_text().splitlines()) == 2 and "| 1 x 1 cells" in (tmp_path / "t.md").read_text()
    )
    assert sorted(file.name for file in tmp_path.iterdir()) == ["t.csv", "t.md"]
