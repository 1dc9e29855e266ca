"""Whatever a file holds or is, it is read or refused within seconds: no cost of input grows with its square or has no
end."""

from __future__ import annotations

import os
import signal
import time
from itertools import combinations

import numpy as np
import pytest

from mitsuba_taxel import InputError, PadFile, Scene, check_scene, read_circuit, sweep
from mitsuba_taxel.characterise.recorded.measurement import read_measurement
from mitsuba_taxel.parts.part import read_part
from mitsuba_taxel.sensing.targets import Settings
from mitsuba_taxel.sensing.validity import shared_places
from mitsuba_taxel.studies.plan.batch import columns_of, make_batch
from mitsuba_taxel.studies.plan.histories import histories
from mitsuba_taxel.studies.plan.refused_values import check_values
from mitsuba_taxel.studies.run.curve_jobs import curve_jobs
from mitsuba_taxel.studies.store.provenance import provenance

PLATE = """<scene version="3.9.0">
    <integrator type="taxel_tracer"/>
    <shape type="photo_reflector">
        <emitter type="annular_led"> {led} </emitter> <sensor type="phototransistor"/>
    </shape>
    {shapes}
</scene>"""
LONGEST = 20
"""Seconds after which a test is ended."""


@pytest.fixture(autouse=True)
def ends():
    """A pipe that is waited for, or work without an end, fails the test."""

    def fail(number, frame):
        raise TimeoutError("no end in sight")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(LONGEST)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def refusal(scene) -> str:
    """The one line that loading refuses a scene with; `check_scene` finds an error as well."""
    with pytest.raises(InputError) as refused:
        Scene(scene).load()
    try:
        assert any(finding.severity == "error" for finding in check_scene(scene))
    except InputError as error:
        assert str(error) == str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize("width, depth", [(10, 9), (2, 14), (1, 40)])
def test_files_that_include_each_other(tmp_path, width, depth):
    for number in range(depth):
        inner = f'<include filename="s{number + 1}.xml"/>' * width
        (tmp_path / f"s{number}.xml").write_text(f'<scene version="3.9.0">{inner}</scene>')
    (tmp_path / f"s{depth}.xml").write_text('<scene version="3.9.0"/>')
    assert "files" in refusal(tmp_path / "s0.xml")


@pytest.mark.parametrize("kind", ["pipe", "device", "huge"])
def test_only_files_of_a_sane_size_are_read(tmp_path, kind, llvm_mono):
    place = tmp_path / "place"
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "device":
        place.symlink_to("/dev/zero")
    else:
        with place.open("wb") as file:
            file.truncate(1 << 40)
    endings = (".csv", ".ply", ".toml", ".stl", ".xml", ".spd", ".obj")
    names = {ending: tmp_path / f"named{ending}" for ending in endings}
    for name in names.values():
        name.symlink_to(place)
    because = "it has 1048576 MB" if kind == "huge" else "it is a pipe, a device or a socket"
    table = '<string name="law" value="tabulated"/> <string name="file" value="named.csv"/>'
    reflectance = '<spectrum name="reflectance" filename="named.spd"/>'
    spectrum = f'<shape type="rectangle"> <bsdf type="diffuse"> {reflectance} </bsdf> </shape>'
    for led, shapes in (
        (table, ""),
        ("", '<shape type="ply"> <string name="filename" value="named.ply"/> </shape>'),
        ("", '<shape type="obj"> <string name="filename" value="named.obj"/> </shape>'),
        ("", '<shape type="deformable_pad"> <string name="filename" value="named.stl"/> </shape>'),
        ("", spectrum),
        ("", '<include filename="named.xml"/>'),
    ):
        scene = tmp_path / "scene.xml"
        scene.write_text(PLATE.format(led=led, shapes=shapes))
        assert because in refusal(scene)
    part = '<shape type="photo_reflector"> <string name="part" value="named.toml"/> </shape>'
    (tmp_path / "scene.xml").write_text(f'<scene version="3.9.0">{part}</scene>')
    assert because in refusal(tmp_path / "scene.xml")
    for read in (
        lambda: PadFile(names[".stl"]),
        lambda: read_part(names[".toml"]),
        lambda: read_circuit(names[".toml"]),
        lambda: read_measurement(names[".csv"]),
        lambda: columns_of(names[".csv"]),
        lambda: sweep("plate.xml", {"z": f"@{names['.csv']}"}),
        lambda: Scene({"type": "scene", "shape": {"type": "ply", "filename": str(names[".ply"])}}).load(),
    ):
        with pytest.raises(InputError, match=because):
            read()
    if kind != "huge":
        with pytest.raises(InputError, match=because):
            Scene(names[".xml"])


def test_many_parameters_terms_and_rows(tmp_path):
    many = "".join(f'<default name="a{number}" value="1"/>' for number in range(1500))
    (tmp_path / "scene.xml").write_text(f'<scene version="3.9.0">{many}</scene>')
    with pytest.raises(InputError, match="1500 parameters is not allowed: at most 1000 are possible"):
        Scene(tmp_path / "scene.xml")
    for name, value, why in (
        ("prony", "; ".join(["1e-7 1"] * 100_000), "prony with 100000 terms is not allowed: at most 100 are"),
        ("history", "; ".join(f"{n} 0 0 -1" for n in range(100_000)), "history with 100000 rows is not allowed"),
    ):
        prony = "" if name == "prony" else '<string name="prony" value="0.1 1"/>'
        pad = f'<shape type="deformable_pad"> {prony} <string name="{name}" value="{value}"/> </shape>'
        (tmp_path / "scene.xml").write_text(PLATE.format(led="", shapes=pad))
        assert why in refusal(tmp_path / "scene.xml")
    with pytest.raises(InputError, match="100000 steps with times are not allowed"):
        histories({"time": ["1"] * 100_000, "fz": ["1"] * 100_000}, {"history": ""})


def test_steps_take_time_in_proportion_to_their_number():
    """Up to the first job: 8000 take less than the 12 CPU s that 5000 took, by far."""
    count = 8000
    rows = {"z": [str(0.5 + number / count) for number in range(count)], "hole": ["0.1"] * count}
    start = time.process_time()
    batch = make_batch("plate.xml", {}, together=rows, points=16)
    check_values(batch)
    provenance(batch)
    (curve,) = curve_jobs(batch, Settings(16, None), True)
    assert len(curve) == count and curve[-1].sides == {"z": -1, "hole": 0}
    assert curve[1].parameters == batch.parameters({"z": rows["z"][1], "hole": "0.1"})
    assert time.process_time() - start < 4


def test_flat_shapes_are_compared_where_they_may_overlap():
    """Of random squares, many of them in one plane, as of all pairs."""
    random = np.random.default_rng(1)
    outlines = []
    for _ in range(60):
        size, centre = 10 ** random.uniform(-2, 1), random.uniform(-3, 3, 3)
        axes = np.roll(np.eye(3), random.integers(3), axis=0)[:2]
        square = size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]) @ axes
        outlines.append(square + np.where(np.abs(square).max(axis=0) > 0, centre, random.integers(-1, 2)))
    pairs = [(a, b) for a, b in combinations(range(60), 2) if shared_places._overlap(outlines[a], outlines[b])]
    near = list(shared_places._pairs_in_one_plane(outlines))
    assert [pair for pair in near if shared_places._overlap(*(outlines[n] for n in pair))] == pairs
    assert 30 < len(pairs) <= len(near) < 800


def test_a_thousand_rectangles_take_seconds(tmp_path):
    moved = '<transform name="to_world"> <scale value="0.01"/> <translate {place}/> </transform>'
    square = f'<shape type="rectangle"> {moved} </shape>'
    places = (f'x="{n % 40 * 0.05 - 1:g}" y="{n // 40 * 0.05 - 1:g}" z="{2 + n % 7}"' for n in range(1000))
    (tmp_path / "scene.xml").write_text(PLATE.format(led="", shapes="".join(square.format(place=p) for p in places)))
    live = Scene(tmp_path / "scene.xml").load()
    start = time.process_time()
    shared_places.refuse_shared_planes(live)
    assert time.process_time() - start < 5
