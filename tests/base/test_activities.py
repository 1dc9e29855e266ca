"""What is done at the moment reaches those that show it, from meshers of all kinds and to the bar of a terminal."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest

from mitsuba_taxel import InputError, Pad, PadFile
from mitsuba_taxel.base.processes.activities import activity, announced_to
from mitsuba_taxel.pads.parametric.meshing import MESHING_LOCK

SCENE = """<scene version="3.9.0">
    <shape type="deformable_pad">
        <string name="filename" value="pad.step"/> <float name="mesh_size" value="2.5"/>
        <bsdf type="region"> <bsdf name="roof" type="wall"/> </bsdf>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
</scene>"""


def write_step(file):
    from netgen.occ import Box, Pnt

    with MESHING_LOCK:
        (Box(Pnt(-3, -2.5, 0), Pnt(3, 2.5, 4)) - Box(Pnt(-1.2, -1.1, -1), Pnt(1.2, 1.1, 1.8))).WriteStep(str(file))
    return file


def test_activities_lie_in_one_another():
    heard = []
    with announced_to(heard.append), activity("outer"):
        with pytest.raises(ValueError), activity("inner"):
            raise ValueError
    with activity("later"):
        pass
    assert heard == ["outer", "inner", "outer", ""]


def test_meshers_say_what_they_mesh(tmp_path):
    heard = []
    with announced_to(heard.append):
        PadFile(write_step(tmp_path / "pad.step")).mesh(2.5)
        Pad("parallelepiped", 1, 1).mesh(2.5)
        (tmp_path / "none.stl").write_text("nothing")
        with pytest.raises(InputError):
            PadFile(tmp_path / "none.stl").mesh(2.5)
    said = [
        "meshing pad.step, elements of 2.5 mm",
        "meshing, elements of 2.5 mm",
        "meshing none.stl, elements of 2.5 mm",
    ]
    assert [words for words in heard if words] == said and heard[-1] == ""


def test_the_bar_of_a_terminal_shows_them(tmp_path):
    """And a pipe gets nothing of it."""
    write_step(tmp_path / "pad.step")
    (tmp_path / "scene.xml").write_text(SCENE)
    ours, theirs = pty.openpty()
    taxel = [sys.executable, "-c", "import taxel_cli; taxel_cli.main()", "check", "scene.xml"]
    about = {**os.environ, "MITSUBA_TAXEL_CACHE": str(tmp_path / "kept"), "TERM": "xterm", "COLUMNS": "160"}
    done = subprocess.Popen(taxel, cwd=tmp_path, env=about, stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    shown = b""
    while True:
        try:
            piece = os.read(ours, 1 << 16)
        except OSError:  # the terminal is closed
            break
        if not piece:
            break
        shown += piece
    out, _ = done.communicate()
    os.close(ours)
    assert done.returncode == 0 and b"meshing" not in out
    assert b"meshing pad.step, elements of 2.5 mm" in shown
