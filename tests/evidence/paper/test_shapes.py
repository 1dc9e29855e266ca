"""The four shapes computed at once, by stand-ins for their studies."""

from __future__ import annotations

import json
import os
import signal
import sys
from functools import partial
from pathlib import Path

import pytest
import xarray as xr

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.shapes import COSTLIEST_FIRST, compute_shapes

PILOT = {"mechanics": 3.0, "optics": 0.25}
READING = 0.5


@pytest.fixture(autouse=True)
def _stand_ins(monkeypatch):
    """Worker processes find the functions of this file, which need not be on their path."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[3])])


def study() -> xr.Dataset:
    """Who computed it, and with seconds as a study of scenes has them."""
    return xr.Dataset(
        {"process": os.getpid(), "seconds": (["fz", "stage"], [[READING, 0.0], [0.0, READING]])},
        {"fz": [0.0, -1.0], "stage": ["load", "optics"]},
        {"pilot_seconds": json.dumps(PILOT)},
    )


def two_studies(store: PaperStudies, cell: str) -> None:
    for number in (1, 2):
        store.study(f"readings/{cell}_{number}", {}, study)


def heights(store: PaperStudies, cell: str) -> None:
    store.study(f"heights/{cell}", {}, lambda: xr.Dataset({"process": os.getpid()}))


def refused(store: PaperStudies, cell: str) -> None:
    if cell == "spherical":
        raise InputError("fz = 1 is not allowed.")


def deadly(store: PaperStudies, cell: str) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def note(file: Path, name: str) -> None:
    with file.open("a") as notes:
        notes.write(f"{name}\n")


def test_what_a_shape_needs_comes_first(tmp_path):
    announce = partial(note, tmp_path / "notes")
    done = tmp_path / "results"
    seconds = compute_shapes(done, [[two_studies], [heights]], 2, announce)
    assert seconds == {stage: 8 * (PILOT.get(stage, 0) + READING * (stage != "mechanics")) for stage in seconds}
    assert list(sorted(seconds)) == ["load", "mechanics", "optics"]
    names = {cell: [f"readings/{cell}_1", f"readings/{cell}_2", f"heights/{cell}"] for cell in paper.CELLS}
    by = {cell: {int(xr.load_dataset(done / f"{name}.nc").process) for name in names[cell]} for cell in names}
    computing = set.union(*by.values())
    assert 1 <= len(computing) <= 2 and os.getpid() not in computing
    announced = (tmp_path / "notes").read_text().split()
    assert sorted(announced) == sorted(sum(names.values(), []))
    assert {cell: [name for name in announced if cell in name] for cell in names} == names
    assert compute_shapes(done, [[two_studies], [heights]], 2, announce) == {}
    assert len((tmp_path / "notes").read_text().split()) == 12


def test_with_one_process_the_costliest_comes_first(tmp_path):
    compute_shapes(tmp_path / "results", [[heights]], 1, partial(note, tmp_path / "notes"))
    assert (tmp_path / "notes").read_text().split() == [f"heights/{cell}" for cell in COSTLIEST_FIRST]
    assert sorted(COSTLIEST_FIRST) == sorted(paper.CELLS)


@pytest.mark.parametrize(
    ("part", "error", "words"),
    [(refused, InputError, "fz = 1 is not allowed"), (deadly, ComputationError, "process died.* fewer workers")],
)
def test_what_ends_a_shape_ends_all(part, error, words, tmp_path):
    with pytest.raises(error, match=words):
        compute_shapes(tmp_path, [[part], [heights]], 2, print)
