"""Files of parts, those of the catalogue and those that are none."""

from __future__ import annotations

import json

import pytest
from taxel_program import run_program

from mitsuba_taxel import InputError
from mitsuba_taxel.parts import part_names, read_datasheet, read_part

pytestmark = pytest.mark.quick

SIDE = "x = {}\nwindow_width = 0.5\nwindow_length = 0.8\ndie_width = 0.2\ndie_length = 0.2\n"
OWN = f"""title = "mine"
source = "a drawing"
body = [2, 1, 0.5]
wavelength = 900
resin_index = 1.4
[emitter]
{SIDE.format(-0.5)}
[detector]
{SIDE.format(0.5)}
"""


def test_the_catalogue_says_where_its_numbers_are_from():
    assert part_names() == ["cny70", "njl5908ar", "qre1113", "tcrt5000", "vcnt2020"]
    for name in part_names():
        sheet = read_datasheet(name.upper())
        assert sheet.source and sheet.unknown and sheet.sources
        if not sheet.missing:
            part = read_part(name)
            assert part.emitter.x < 0 < part.detector.x


def test_unknown_numbers_are_read_and_named_where_they_are_needed(tmp_path):
    (tmp_path / "mine.toml").write_text(
        OWN.replace("index = 1.4", 'index = "unknown"').replace("die_width = 0.2", 'die_width = "unknown"', 1)
    )
    sheet = read_datasheet(tmp_path / "mine.toml")
    assert sheet.missing == ("resin_index", "emitter.die_width") and sheet.stated["detector"]["die_width"] == 0.2
    with pytest.raises(InputError, match="states as unknown resin_index, emitter.die_width. A file of your own"):
        read_part(tmp_path / "mine.toml")
    part = sheet.with_numbers({"resin_index": 1.5, "emitter.die_width": 0.3})
    assert part.resin_index == 1.5 and part.emitter.die_width == 0.3 and part.missing == ()
    with pytest.raises(InputError, match="emitter: its die extends beyond the edge"):
        sheet.with_numbers({"resin_index": 1.5, "emitter.die_width": 1.5})
    with pytest.raises(InputError, match="unknown emitter.die_width"):
        sheet.with_numbers({"resin_index": 1.5})


def test_what_is_known_of_a_part_is_shown_and_a_reading_of_it_refused(tmp_path):
    shown = run_program(tmp_path, "parts", "tcrt5000").stdout
    assert "No reading can be computed" in shown and "lenses" in shown and "2.5" in shown
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.9.0"><shape type="photo_reflector"><string name="part" value="tcrt5000"/></shape></scene>'
    )
    drawn, circuit = ("parts", "tcrt5000", "-o", "a.png"), ("new", "circuit", "--part", "tcrt5000")
    for words in (drawn, circuit, ("render", "scene.xml")):
        refused = run_program(tmp_path, *words)
        assert refused.returncode == 2 and "unknown resin_index, emitter.x" in refused.stderr
        assert refused.stderr.count("\n") == 1


def test_a_part_of_ones_own(tmp_path):
    (tmp_path / "mine.toml").write_text(OWN)
    part = read_part(tmp_path / "mine.toml")
    assert part.name == "mine" and part.detector.x == 0.5 and part.emitter.die_depth == 0 and part.distance_curve == ()


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('title = "mine"\n', "", "title is missing"),
        ("body = [2, 1, 0.5]", "body = [2, 1]", "body = [2, 1] is not allowed"),
        ("body = [2, 1, 0.5]", "body = [2, 1, 0]", "body = [2, 1, 0] is not allowed"),
        ("resin_index = 1.4", "resin_index = 0.9", "resin_index = 0.9"),
        ("wavelength", "length", "length is not known"),
        ("x = -0.5\n", "", "emitter: x is missing"),
        ("x = -0.5\n", "x = -0.5\nz = 1\n", "z of emitter is not known"),
        ("x = -0.5\n", "x = 'unknown'\nwindow_shape = 'unknown'\n", "window_shape = 'unknown' is not allowed"),
        ("x = -0.5\n", "x = 'unknown'\ndie_depth = -1\n", "emitter: die_depth = -1"),
        ("body = [2, 1, 0.5]", "body = 'unknown'", "body = 'unknown' is not allowed"),
        ("x = -0.5\n", "x = -0.5\ndie_depth = -1\n", "emitter: die_depth = -1"),
        ("x = -0.5\n", "x = -0.5\nwindow_shape = 'star'\n", "window_shape = 'star'"),
        ("x = -0.5\n", "x = -0.8\n", "emitter: its window extends beyond the edge of the body along x"),
        ("x = -0.5\n", "x = -0.5\nwindow_y = 0.2\n", "emitter: its window extends beyond the edge of the body along y"),
        ("x = -0.5\n", "x = -0.95\nwindow_x = -0.5\n", "emitter: its die extends beyond the edge of the body along x"),
        ("x = -0.5\n", "x = -0.5\ndie_depth = 0.5\n", "emitter: die_depth = 0.5 is not allowed"),
        ("x = -0.5\n", "x = -0.5\nlaw = 'lobe'\n", "emitter: law = 'lobe'"),
        ("x = -0.5\n", "x = -0.5\nexponent = 2\n", "exponent is not allowed for law = 'lambertian'"),
        ("x = -0.5\n", "x = -0.5\nlaw = 'cosine_power'\nexponent = 0.5\n", "emitter: exponent = 0.5"),
        ("x = -0.5\n", "x = -0.5\nlaw = 'cosine_power'\ndie_depth = 0.1\n", "a die below its window: 'lambertian'"),
        ("[emitter]", "[sources]\ndepth = 'a ruler'\n[emitter]", "sources has depth, which the file does not contain"),
        ("[emitter]", "[sources]\n'emitter.y' = 'a ruler'\n[emitter]", "sources has emitter.y, which"),
        ("[emitter]", "[sources]\nbody = 1\n[emitter]", "a table of words is needed"),
        ("[emitter]", "emitter", "is not valid TOML"),
        ("[detector]", "distance_curve = [[1, 1]]\n[detector]", "distance_curve is in [emitter]: move it above"),
        ("[emitter]", "[sources]\ndistance_curve = [[1, 1]]\n[emitter]", "distance_curve is in [sources]: move"),
    ],
)
def test_what_is_no_part_is_refused(tmp_path, before, after, said):
    (tmp_path / "mine.toml").write_text(OWN.replace(before, after, 1))
    with pytest.raises(InputError) as refused:
        read_part(tmp_path / "mine.toml")
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.usefixtures("painted_figures")
def test_the_program(tmp_path):
    listed = run_program(tmp_path, "parts")
    assert listed.returncode == 0 and "Vishay VCNT2020" in listed.stdout
    one = run_program(tmp_path, "parts", "vcnt2020", "-o", "part.png", "--json")
    answer = json.loads(one.stdout)
    assert (tmp_path / "part.png").stat().st_size and len(answer["model_curve"]) == 13
    assert "Largest difference: 2.4% of the peak" in run_program(tmp_path, "parts", "vcnt2020").stdout
    for words, culprit in (
        (("parts", "x1"), "part = 'x1' is not known"),
        (("parts", "-o", "a.png"), "-o is not allowed"),
        (("parts", "vcnt2020", "--edges", "-1"), "height = -1.0 is not allowed"),
    ):
        bad = run_program(tmp_path, *words)
        assert bad.returncode == 2 and culprit in bad.stderr and bad.stderr.count("\n") == 1
