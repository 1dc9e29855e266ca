"""Study files and folders of results that are damaged: they are read, or refused in one line."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from taxel_program import run_program

from mitsuba_taxel import ComputationError, InputError, open_study, sweep
from mitsuba_taxel.base.files import archive
from mitsuba_taxel.pads.imported.rules import read_rules
from mitsuba_taxel.studies.plan.batch import batch_from, read_study
from mitsuba_taxel.studies.store import tables
from mitsuba_taxel.studies.store.status import study_status

STUDY = """scene = "plate.xml"
points = 64
seed = 2
maps = false
[define]
hole = 0
[vary]
z = "0.6:0.8:0.1"
[together]
spacing = [0.8, 0.9]
width = [3, 4]
"""
SEVERAL = """points = 64
[[scenes]]
name = "one"
scene = "plate.xml"
vary = { z = [0.6] }
[[scenes]]
scene = "plate.xml"
steps = "steps.csv"
"""
VALUES = [
    "1", "-1", "nan", "inf", "1e308", "true", '""', '"a"', "[]", "[[]]", "{}", "{ a = 1 }", "1979-05-27", "9" * 400,
    '"nan:1:2"', '"sNaN:1:2"', '"0:1:1e-999999"', '"@"', '"@\\u0000"', '"\\u0000"', '"::"', '["1", "1.0"]',
    "9" * 5000, '"' + 5000 * "a" + '"', 2000 * "[" + 2000 * "]",
]  # fmt: skip

few = settings(max_examples=60)


def refused(read, *arguments) -> str | None:
    """What a reader says in one line, if it refuses; any other error is a failure of the test."""
    try:
        read(*arguments)
    except (InputError, ComputationError) as error:
        assert str(error) and "\n" not in str(error)
        return str(error)
    return None


def all_batches(file: Path) -> None:
    study = read_study(file)
    for number in range(len(study["scenes"])):
        batch_from(study, number, file.parent)


def damaged_lines(data: st.DataObject, text: str) -> str:
    """Lines that are taken out, doubled, put elsewhere, or say something else."""
    lines = text.splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        what = data.draw(st.sampled_from(["value", "value", "value", "remove", "double", "name"]))
        if what == "value" and " = " in lines[at]:
            lines[at] = lines[at].split(" = ")[0] + " = " + data.draw(st.sampled_from(VALUES))
        elif what == "name":
            lines[at] = re.sub(
                r"\w+", data.draw(st.sampled_from(["vary", "scene", "a.b", "step", '""', "x y"])), lines[at]
            )
        elif what == "double":
            lines.insert(data.draw(st.integers(0, len(lines))), lines[at])
        elif len(lines) > 1:
            del lines[at]
    return "\n".join(lines)


@pytest.mark.parametrize("text", [STUDY, SEVERAL])
@few
@given(data=st.data())
def test_a_damaged_study_is_read_or_refused(data, text, tmp_path):
    (tmp_path / "steps.csv").write_bytes(
        data.draw(st.sampled_from([b"z\n0.6\n", b"z\n\x00\n", b"", b"\xff", b'z\n"0.6\n']))
    )
    content = bytearray(damaged_lines(data, text).encode())
    for _ in range(data.draw(st.integers(0, 2)) if content else 0):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file = tmp_path / "study.toml"
    file.write_bytes(content)
    refused(all_batches, file)


@pytest.mark.parametrize(
    "text, message",
    [
        ("a = " + 100_000 * "[" + 100_000 * "]", "is not allowed: it is nested too deeply"),
        (".".join(100_000 * ["a"]) + " = 1", "is not allowed: it is nested too deeply"),
        (STUDY.replace("64", 10_000 * "9"), "is not valid TOML: .* digits"),
        (SEVERAL.replace('"one"', '["one"]'), "names = .* are not allowed: letters"),
        (STUDY.replace("plate.xml", 5000 * "a"), "cannot be read: File name too long"),
        (STUDY.replace('"0.6:0.8:0.1"', '"@' + "\\u0000" + '"'), "cannot be read"),
        (STUDY.replace('"0.6:0.8:0.1"', '"sNaN:1:2"'), "finite numbers, none too close to 0"),
        (STUDY.replace('"0.6:0.8:0.1"', '"1e308:2:1e-999990"'), "finite numbers, none too close to 0"),
        (STUDY.replace('"0.6:0.8:0.1"', '"1e-999999:2e-999999:1e-999999"'), "finite numbers, none too close to 0"),
        (SEVERAL.replace("steps.csv", "\\u0000"), "cannot be read"),
        (SEVERAL.replace("steps.csv", "long.csv"), "is not a table: field larger than field limit"),
        (STUDY.replace("[define]\nhole = 0", "define = 1"), "define = 1 is not allowed: a table"),
    ],
)
def test_extremes_of_a_study_are_refused(tmp_path, text, message):
    (tmp_path / "long.csv").write_text("z\n" + 200_000 * "1" + "\n")
    file = tmp_path / "study.toml"
    file.write_text(text)
    assert re.search(message, refused(all_batches, file))


@pytest.mark.parametrize(
    "rule", [100_000 * "[" + 100_000 * "]", 400 * "9", 10_000 * "9", "0x" + 400 * "f", '"a\\nb"', "1979-05-27"]
)
@pytest.mark.parametrize("name", ["above", "normal", "within", "region", "face", '"a\\nb"'])
def test_rules_of_regions_are_read_or_refused(tmp_path, name, rule):
    file = tmp_path / "rules.toml"
    file.write_text(
        f"[[rule]]\n{name} = {rule}\n{'' if name == 'region' else chr(10) + 'region = ' + chr(34) + 'roof' + chr(34)}"
    )
    assert name == "face" and rule.startswith('"') or refused(read_rules, file)


@pytest.fixture(scope="module")
def no_plots():
    """Sweeps leave their plots empty, of which no test here speaks and each takes a second."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tables, "save_figure", lambda figure, folder, name: (folder / f"{name}.png").touch())
        yield


@pytest.fixture(scope="module")
def finished(tmp_path_factory, no_plots):
    """A folder with a finished study, whose points pilot runs have chosen."""
    folder = tmp_path_factory.mktemp("study") / "out"
    again(folder)
    return folder


def again(folder: Path):
    return sweep("plate.xml", {"z": "0.6,0.7"}, {"hole": 0}, target_error=0.2, output=folder)


READERS = {"open": open_study, "status": study_status, "go on": again}


def packed(content: bytes) -> bytes:
    return hashlib.sha256(content).digest() + content


def resealed(folder: Path, **words: object) -> bytes:
    """A result that is whole, and says other things."""
    arrays = archive.unpack((folder / "jobs" / "000000.npz").read_bytes())
    return archive.pack({**arrays, "words": np.array(json.dumps({**json.loads(str(arrays["words"])), **words}))})


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    "name, content",
    {
        "emptied": ("jobs/000000.npz", b""),
        "sealed but empty": ("jobs/000000.npz", packed(b"")),
        "sealed but no archive": ("jobs/000000.npz", packed(b"PK\x03\x04 junk")),
        "sealed but a pickle": ("jobs/000000.npz", packed(b"\x80\x04cos\nsystem\n(S'true'\ntR.")),
        "other remarks": ("jobs/000000.npz", {"remarks": 1}),
        "other seconds": ("jobs/000000.npz", {"seconds": ["a"]}),
        "other files": ("jobs/000000.npz", {"files": [None]}),
        "foreign file": ("jobs/notes.npz", b""),
        "foreign number": ("jobs/0.5.npz", b""),
        "a job too many": ("jobs/000099.npz", b""),
        "a failure too many": ("failed/000099.json", b'{"message": "no luck"}'),
        "an empty failure": ("failed/000001.json", b""),
        "a list as failure": ("failed/000001.json", b"[]"),
        "a deep failure": ("failed/000001.json", 100_000 * b"["),
        "a failure that is no text": ("failed/000001.json", b"\xff\xfe"),
        "empty points": ("points.json", b""),
        "points of another kind": ("points.json", b'{"points": "a", "mesh_size": [], "pilot_seconds": 3}'),
        "deep points": ("points.json", 100_000 * b"["),
        "points that are no text": ("points.json", b"\xff\xfe"),
        "empty run": ("run.json", b""),
        "empty study": ("study.toml", b""),
        "study that is no text": ("study.toml", b"\xff\xfe"),
        "study of no run": ("study.toml", b'scene = "plate.xml"\npoints = 64\nvary = { z = [0.6, 0.7] }\n'),
        "study of one scene": (
            "study.toml",
            b'scene = "plate.xml"\nseed = 0\n[vary]\nz = [0.6]\n[provenance]\nversions={}\n',
        ),
    }.values(),
)
def test_a_damaged_folder_is_read_or_refused(tmp_path, finished, reader, name, content):
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)
    (folder / name).write_bytes(resealed(finished, **content) if isinstance(content, dict) else content)
    said = refused(READERS[reader], folder)
    if name.startswith(("jobs/", "failed/")):
        assert said is None  # done again, or none of the study's


@pytest.mark.parametrize("value", ["[]", "{ a = 1 }", "1979-05-27", 400 * "9"])
@pytest.mark.parametrize("name", ["target_error", "seed", "hole", "z"])
def test_a_value_of_another_kind_beside_results_is_refused(tmp_path, finished, name, value):
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)
    text = (finished / "study.toml").read_text()
    (folder / "study.toml").write_text(re.sub(rf"(?m)^{name} = [^\[\n]*$", f"{name} = {value}", text))
    assert refused(open_study, folder) and refused(study_status, folder)
    assert bool(refused(again, folder)) == (name != "target_error")  # which the new one replaces


@pytest.mark.parametrize("forces", ["3", "[]", '{ fz = "fz" }', "{ fz = [1979-05-27, 1] }"])
def test_forces_of_another_kind_beside_results_are_refused(tmp_path, finished, forces):
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)
    above, below = (finished / "study.toml").read_text().split("[provenance]")
    kept = re.sub(r"\[provenance\.forces\][^\[]*(\w+ = \[[^\]]*\]\s*)*", "", below)
    assert "forces" not in kept
    (folder / "study.toml").write_text(f"{above}[provenance]\nforces = {forces}\n{kept}")
    assert all(refused(reader, folder) for reader in READERS.values())


@few
@given(data=st.data())
def test_a_damaged_study_beside_results_is_read_or_refused(data, tmp_path, finished):
    folder = tmp_path / "out"
    if not folder.exists():
        shutil.copytree(finished, folder)
    text = damaged_lines(data, (finished / "study.toml").read_text())
    (folder / "study.toml").write_text(text)
    for reader in READERS.values():
        refused(reader, folder)


def test_scenes_of_different_taxels_make_no_study(tmp_path):
    from mitsuba_taxel.sensing import find_scene

    text = find_scene("plate.xml").read_text().replace("<integrator", '<default name="rows" value="1"/> <integrator')
    scene = tmp_path / "rows.xml"
    scene.write_text(
        text.replace('<float name="spacing"', '<integer name="rows" value="$rows"/> <float name="spacing"')
    )
    assert "scenes of 1 and 2 taxels" in refused(lambda: sweep(scene, {"rows": "1,2"}, points=4))


@pytest.mark.parametrize(
    "command, name, content",
    [
        ("render", "broken.xml", b"\xff\xfe<scene"),
        ("sweep", "broken.toml", b"a = " + 100_000 * b"["),
        ("status", "study.toml", b"points = 64\n"),
    ],
)
def test_the_program_says_it_in_one_line(tmp_path, command, name, content):
    (tmp_path / name).write_bytes(content)
    words = {"render": [name], "sweep": [name, "-o", "out"], "status": ["."]}[command]
    done = run_program(tmp_path, command, *words)
    assert done.returncode == 2 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("taxel: ")
