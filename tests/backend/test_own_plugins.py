"""Plugins in Python files that the user names, in Python and on the command line."""

from __future__ import annotations

import pytest
from own_wall import PLATE_OF_ONES_OWN, darkened_wall
from taxel_program import run_program

from mitsuba_taxel import InputError, Scene, load_plugins, measure
from mitsuba_taxel.backend import own_plugins


@pytest.fixture(autouse=True)
def forgotten(monkeypatch, llvm_mono):
    monkeypatch.setattr(own_plugins, "_LOADED", {})


def test_a_wall_of_ones_own_reads_as_that_of_mitsuba(tmp_path, agree):
    """On the command line, in Python, and beside a Lambertian `wall`; a scene alone brings no code."""
    darkened_wall(tmp_path / "own_wall_a.py")
    (tmp_path / "own.xml").write_text(PLATE_OF_ONES_OWN.format("own_wall_a"))
    without = run_program(tmp_path, "render", "own.xml", "--points", 64)
    assert without.returncode == 2 and "taxel --plugin FILE.py" in without.stderr
    behind = run_program(tmp_path, "render", "own.xml", "--plugin", "own_wall_a.py")
    assert behind.returncode == 2 and "it stands before render: taxel --plugin FILE.py render ..." in behind.stderr
    printed = run_program(tmp_path, "--plugin", "own_wall_a.py", "render", "own.xml", "--points", 64, "-D", "share=0.7")
    own = measure(Scene(tmp_path / "own.xml", {"share": 0.7}), points=64)
    assert f"{own.power[0]:.6e}" in printed.stdout
    lambertian = PLATE_OF_ONES_OWN.format("wall").replace("share", "reflectance")
    (tmp_path / "wall.xml").write_text(
        lambertian.replace("</bsdf>", '<string name="scattering" value="lambertian"/></bsdf>')
    )
    wall = measure(Scene(tmp_path / "wall.xml", {"reflectance": 0.7}), points=256, seed=1)
    if wall.points:
        agree(own.power, own.standard_error, wall.power, wall.standard_error)
    else:
        agree(own.power, own.standard_error, wall.power)


def test_results_are_of_the_file_as_it_was(tmp_path):
    """A folder is not extended by another plugin, or by none, which the message says."""
    darkened_wall(tmp_path / "own_wall_b.py")
    (tmp_path / "own.xml").write_text(PLATE_OF_ONES_OWN.format("own_wall_b"))
    command = ["sweep", "own.xml", "--vary", "share=1", "--points", 1, "-o", "out"]
    assert run_program(tmp_path, "--plugin", "own_wall_b.py", *command).returncode == 0
    own_plugins._LOADED.clear()
    refused = run_program(tmp_path, *command)
    assert refused.returncode == 2 and "out holds another study (it needs --plugin own_wall_b.py)" in refused.stderr
    (tmp_path / "own_wall_b.py").write_text((tmp_path / "own_wall_b.py").read_text() + "# changed\n")
    refused = run_program(tmp_path, "--plugin", "own_wall_b.py", *command)
    assert "plugin own_wall_b.py has changed since" in refused.stderr


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("absent.py", None, "plugin = .*absent.py' is not allowed: an existing file that ends in .py is needed"),
        ("scene.xml", "<scene/>", "plugin = .*scene.xml' is not allowed"),
        ("broken.py", "1 / 0", "plugin = 'broken.py' cannot be run: ZeroDivisionError: division by zero"),
        ("other.py", "import mitsuba as mi\nmi.set_variant('scalar_rgb')", "it changes the variant"),
    ],
)
def test_refused_in_one_line(tmp_path, name, text, said):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said):
        load_plugins(tmp_path / name)
    assert own_plugins.loaded_plugins() == ()
