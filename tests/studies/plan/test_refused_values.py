"""A value that no scene takes is refused before anything is written, and does no harm to the study beside it."""

from __future__ import annotations

import pytest

from mitsuba_taxel import InputError, open_study, sweep
from mitsuba_taxel.studies.plan.batch import make_batch
from mitsuba_taxel.studies.plan.refused_values import check_values
from mitsuba_taxel.studies.run import study

RUN = {"points": 16, "seed": 3}
SCENE = """<scene version="3.9.0">
    <default name="fz" value="0"/> <default name="cell_size" value="2.5"/> <default name="wall" value="1"/>
    <default name="size" value="0.25"/> <default name="hole" value="0.1"/>
    <shape type="deformable_pad">
        <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="cell_size" value="$cell_size"/> <float name="wall" value="$wall"/>
        <vector name="force" value="0, 0, $fz"/>
    </shape>
    <shape type="photo_reflector">
        <emitter type="annular_led"> <float name="size" value="$size"/> <float name="hole" value="$hole"/> </emitter>
        <sensor type="phototransistor"/>
    </shape>
</scene>"""


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "cell.xml"
    file.write_text(SCENE)
    return file


@pytest.mark.parametrize(
    ("vary", "together", "message"),
    [
        ({"fz": "0..-2"}, {}, r"fz=0\.\.-2: cell\.xml: .*could not parse"),
        ({"cell_size": "2.5,0"}, {}, "cell_size=0: cell_size = 0 is not allowed"),
        ({"wall": "1,0.9", "cell_size": "2.5,2.4,-1"}, {}, "cell_size=-1: cell_size = -1 is not allowed"),
        ({}, {"fz": [0, -1], "wall": [1, "thin"]}, "fz=-1, wall=thin: cell.xml: .*could not parse"),
        ({"fz": [*range(-70, 0), "-1e", 0]}, {}, "fz=-1e: cell.xml: .*could not parse"),
        ({"cell_size": [2 + i / 100 for i in range(99)] + [-2]}, {}, "cell_size=-2: cell_size = -2 is not allowed"),
    ],
)
def test_refused_before_anything_is_written(scene, tmp_path, vary, together, message):
    with pytest.raises(InputError, match=f"^{message}"):
        sweep(scene, vary, together=together, output=tmp_path / "out", **RUN)
    assert not (tmp_path / "out").exists()


def test_what_only_some_combinations_refuse_is_no_impossible_value(scene):
    check_values(make_batch(scene, {"size": "0.2,0.4", "hole": "0.1,0.3"}, points=16))
    with pytest.raises(InputError, match=r"hole=0\.5: hole = 0\.5 is not allowed"):
        check_values(make_batch(scene, {"size": "0.2,0.4", "hole": "0.1,0.5"}, points=16))


def poisoned(monkeypatch, *arguments, **how) -> None:
    """A study begun without the check, as by an earlier version."""
    with monkeypatch.context() as patch:
        patch.setattr(study, "check_values", lambda batch: None)
        sweep(*arguments, **RUN, **how)


def test_a_study_without_a_result_is_begun_anew(tmp_path, monkeypatch):
    folder = tmp_path / "out"
    with pytest.raises(InputError):
        poisoned(monkeypatch, "plate.xml", {"z": "0..2"}, output=folder)
    assert (folder / "study.toml").is_file() and list(folder.glob("failed/*"))
    right = sweep("plate.xml", {"z": "0.6,0.7"}, output=folder, **RUN)
    assert open_study(folder).z.values.tolist() == right.z.values.tolist() == [0.6, 0.7]
    assert right.attrs["failures"] == "" and not list(folder.glob("failed/*"))


@pytest.mark.parametrize("typo", ["0..2", "-1"])
def test_a_value_that_failed_leaves_the_study_when_it_is_not_asked_for_again(tmp_path, monkeypatch, typo):
    folder = tmp_path / "out"
    poisoned(monkeypatch, "plate.xml", {"spacing": ["0.8", typo], "z": "0.6,0.7"}, output=folder)
    assert len(list(folder.glob("failed/*"))) == 2
    right = sweep("plate.xml", {"spacing": "0.8,0.9", "z": "0.6,0.8"}, output=folder, **RUN)
    assert right.spacing.values.tolist() == [0.8, 0.9] and right.z.values.tolist() == [0.6, 0.7, 0.8]
    assert right.power.notnull().all() and not list(folder.glob("failed/*"))
    alone = sweep("plate.xml", {"spacing": "0.8,0.9", "z": "0.6,0.7,0.8"}, **RUN)
    assert (right.power == alone.power).all()


def test_no_result_is_lost_where_the_folder_was_not_begun_by_a_run(tmp_path):
    """A study file of one's own, in the folder that is given for results, stays."""
    sweep("plate.xml", {"z": "0.6"}, output=tmp_path / "out", **RUN)
    own = tmp_path / "own"
    own.mkdir()
    content = (tmp_path / "out" / "study.toml").read_text()
    (own / "study.toml").write_text(content)
    with pytest.raises(InputError, match="holds another study"):
        sweep("plate.xml", {"z": "0.7"}, output=own, **RUN)
    assert (own / "study.toml").read_text() == content


@pytest.mark.parametrize("folder", [None, "out"])
def test_a_derivative_that_no_scene_has_is_refused_before_any_is_solved(scene, tmp_path, monkeypatch, folder):
    """One that some have is not."""
    monkeypatch.setattr(study, "run_batch", lambda *_: "run")
    output = folder and tmp_path / folder
    with pytest.raises(
        InputError, match="^hight has no derivative: .* parameters fz, cell_size, wall, size, hole; numb"
    ):
        sweep(scene, {"fz": [0, -1]}, derivatives=["fz", "hight"], output=output, **RUN)
    assert not (tmp_path / "out").exists()
    assert sweep(scene, {"hole": ["none", "0.1"]}, derivatives=["hole"], output=output, **RUN) == "run"
