"""Requests that cannot be met: one line that names the culprit, exit code 2, nothing on stdout."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.quick

MISSPELT = """<scene version="3.9.0">
    <shape type="photo_reflector">
        <float name="spacin" value="0.9"/>
        <emitter type="annular_led"/> <sensor type="phototransistor"/>
    </shape>
    <integrator type="taxel_tracer"/>
</scene>"""
SWEEP = ("sweep", "plate.xml", "--points", 64)

CASES = {
    "unknown cell": (("render", "pad.xml", "-D", "cell=round"), "round"),
    "a memory of all stress": (("render", "pad.xml", "-D", "prony=0.5 1; 0.5 2"), "add up to 1"),
    "Mullins' effect with relaxation": (
        ("render", "pad.xml", "-D", "prony=0.1 1", "-D", "mullins=2 0.1"),
        "only one of both",
    ),
    "Mullins' effect without its constants": (("render", "pad.xml", "-D", "mullins=2"), "'r m beta'"),
    "a gain by Mullins' effect": (("render", "pad.xml", "-D", "mullins=0.5 0.1"), "mullins r = 0.5"),
    "slopes with Mullins' effect": (("render", "pad.xml", "-D", "mullins=2 0.1", "--derivatives", "fz"), "Mullins"),
    "times that go back": (("render", "pad.xml", "-D", "prony=0.1 1", "-D", "history=3 0 0 -1"), "at least 3 s"),
    "slopes with a memory": (("render", "pad.xml", "-D", "prony=0.1 1", "--derivatives", "fz"), "viscoelastic"),
    "negative modulus": (("render", "pad.xml", "-D", "youngs_modulus=-1"), "youngs_modulus"),
    "modulus not finite": (("render", "pad.xml", "-D", "youngs_modulus=nan"), "youngs_modulus"),
    "modulus infinite": (("render", "pad.xml", "-D", "youngs_modulus=inf"), "youngs_modulus"),
    "poisson ratio": (("render", "pad.xml", "-D", "poisson_ratio=0.6"), "poisson_ratio"),
    "force is a word": (("render", "pad.xml", "-D", "fz=much"), "fz"),
    "force not finite": (("render", "pad.xml", "-D", "fz=nan"), "force"),
    "no such scene": (("render", "nowhere.xml"), "nowhere.xml"),
    "no XML": (("render", "broken.xml"), "broken.xml"),
    "misspelt parameter": (("render", "misspelt.xml"), "spacin"),
    "unknown name": (("render", "plate.xml", "-D", "zz=1"), "zz"),
    "no value": (("render", "plate.xml", "-D", "z"), "name=value"),
    "value twice": (("render", "plate.xml", "-D", "z=1", "-D", "z=2"), "twice"),
    "target error a word": (("render", "plate.xml", "--target-error", "small"), "small"),
    "target error negative": (("render", "plate.xml", "--target-error", "-1%"), "-1%"),
    "target error too large": (("render", "plate.xml", "--target-error", "200%"), "200%"),
    "target error nan": (("render", "plate.xml", "--target-error", "nan"), "nan"),
    "target and points": (("render", "plate.xml", "--target-error", "1%", "--points", 64), "points"),
    "time budget a word": (("render", "plate.xml", "--time-budget", "soon"), "'soon'"),
    "time budget in hours": (("render", "plate.xml", "--time-budget", "1h"), "'1h'"),
    "time budget nothing": (("render", "plate.xml", "--time-budget", "0s"), "'0s'"),
    "time budget infinite": (("render", "plate.xml", "--time-budget", "inf"), "'inf'"),
    "rays of no taxel": (("rays", "plate.xml", "--taxel", 2), "taxel = 2"),
    "rays without number": (("rays", "plate.xml", "--count", 0), "--count"),
    "rays as bitmap": (("rays", "plate.xml", "-o", "rays.bmp"), "rays.bmp"),
    "rays as no VTK": (("rays", "plate.xml", "--vtk", "rays.vtu"), ".vtk"),
    "rays write-protected": (("rays", "plate.xml", "-o", "/proc/rays.png"), "/proc/rays.png"),
    "seed": (("render", "plate.xml", "--seed", "-1"), "seed"),
    "map is no EXR": (("render", "plate.xml", "-o", "map.png"), ".exr"),
    "map in no folder": (("render", "plate.xml", "-o", "nowhere/map.exr"), "nowhere/map.exr"),
    "map write-protected": (("render", "plate.xml", "-o", "/proc/map.exr"), "/proc/map.exr"),
    "map is a folder": (("render", "plate.xml", "-o", "folder.exr"), "folder.exr"),
    "sweep write-protected": ((*SWEEP, "--vary", "z=1,2", "-o", "/proc/study"), "/proc/study"),
    "sweep into a file": ((*SWEEP, "--vary", "z=1,2", "-o", "broken.xml"), "broken.xml"),
    "sweep into another study": ((*SWEEP, "--vary", "z=1,2", "-o", "."), "not empty"),
    "deform write-protected": (("deform", "pad.xml", "-o", "/proc/pad"), "/proc/pad"),
    "deform without pad": (("deform", "plate.xml", "-o", "out"), "deformable_pad"),
    "a value that is no text": (("render", "plate.xml", "-D", "law=\udcff"), "law = '\\udcff'"),
    "vary unknown name": ((*SWEEP, "--vary", "zz=1,2", "-o", "out"), "zz"),
    "vary empty": ((*SWEEP, "--vary", "z=0:1:-0.5", "-o", "out"), "empty"),
    "vary endless": ((*SWEEP, "--vary", "z=0:1:0", "-o", "out"), "endless"),
    "vary huge": ((*SWEEP, "--vary", "z=0:1:1e-300", "-o", "out"), "100000"),
    "vary nothing": ((*SWEEP, "--vary", "z=", "-o", "out"), "name=value"),
    "vary and define": ((*SWEEP, "--vary", "z=1,2", "-D", "z=1", "-o", "out"), "both"),
    "vary to a bad value": ((*SWEEP, "--vary", "law=silent,loud", "-o", "out"), "law=silent"),
    "optimise without a study": (("optimise", "none.toml", "-o", "out"), "none.toml"),
    "tolerance without a study": (("tolerance", "none.toml", "-o", "out"), "none.toml"),
    "vary a result": ((*SWEEP, "--vary", "power=1,2", "-o", "out"), "power cannot be varied"),
    "no plugin": (("plugins", "wal"), "wal"),
    "no command": (("renderr",), "renderr"),
    "no scene": (("render",), "SCENE"),
}


@pytest.mark.parametrize("words, culprit", CASES.values(), ids=CASES.keys())
def test_one_line_and_exit_code_2(taxel, tmp_path, words, culprit):
    (tmp_path / "broken.xml").write_text("<scene><shape</scene>")
    (tmp_path / "misspelt.xml").write_text(MISSPELT)
    (tmp_path / "folder.exr").mkdir()
    done = taxel(*words)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("taxel: ") and culprit in line


def test_traceback_only_on_request(taxel):
    done = taxel("render", "nowhere.xml", "--debug")
    assert done.returncode == 2
    assert "Traceback" in done.stderr and done.stderr.splitlines()[-1].startswith("taxel: ")
