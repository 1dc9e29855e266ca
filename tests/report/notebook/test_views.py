"""What notebooks show: well-formed, with the numbers of the objects, and nothing unescaped."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
from dataclasses import dataclass
from html.parser import HTMLParser
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
import xarray as xr

import mitsuba_taxel
from mitsuba_taxel import (
    Circuit,
    InputError,
    Mullins,
    NeoHookean,
    Pad,
    PadFile,
    PadSensor,
    Readings,
    Scene,
    Yeoh,
    load_path,
    show,
)
from mitsuba_taxel.electronics import with_volts
from mitsuba_taxel.mechanics.materials.silicones import SILICONES
from mitsuba_taxel.sensing import find_scene

VOID = {"img", "meta"}


class Balanced(HTMLParser):
    """Checks that every element ends where it should, and keeps the text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        assert tag != "script"
        if tag not in VOID and not self.get_starttag_text().endswith("/>"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        pass

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def text_of(html: str) -> str:
    return " ".join(Balanced(html).words)


def drawing_of(html: str) -> ElementTree.Element:
    return ElementTree.fromstring(re.search("<svg.*</svg>", html)[0])


@pytest.mark.parametrize("cell", ["parallelepiped", "cylindrical", "spherical", "hemispheric"])
@pytest.mark.parametrize("rows, columns", [(1, 1), (2, 3)])
def test_pad(cell, rows, columns):
    pad = Pad(cell=cell, rows=rows, columns=columns, wall=1.25)
    html = pad._repr_html_()
    words = text_of(html).split()
    length, depth, height = pad.extent
    for dimension in (length, depth, height, pad.wall, pad.cell_size, pad.top_of_cell):
        assert f"{dimension:.4g}" in words
    assert ("3.55" in words) == (columns > 1)
    assert {str(number) for number in range(1, rows * columns + 1)} <= set(words)
    drawing = drawing_of(html)
    assert drawing.get("role") == "img" and cell in drawing.get("aria-label")
    assert "black" not in html and "#000" not in html  # legible on any ground


def test_section_is_to_scale():
    """Corners of the outline, from pixels back to mm."""
    pad = Pad(cell="hemispheric", rows=1, columns=2)
    section = drawing_of(pad._repr_html_()).findall("{*}path")[0].get("d")
    corners = np.array(re.findall(r"[ML]([\d.]+) ([\d.]+)", section), dtype=float)
    mm = (corners - corners[0]) * (1, -1) * pad.extent[0] / 300
    wall, size, side = pad.wall, pad.cell_size, pad.side_height
    expected = [(0, 0), (wall, 0), (wall, side), (wall + size, 0)]
    assert mm[:4] == pytest.approx(np.array(expected), abs=0.001)
    assert mm[-2:] == pytest.approx(np.array([(pad.extent[0], pad.height), (0, pad.height)]), abs=0.001)


def test_pad_with_many_cells_is_small():
    assert len(Pad(rows=100, columns=100)._repr_html_()) < 1e6


def test_pad_file():
    html = PadFile(find_scene("hexagonal.xml").with_name("hexagonal.stl"))._repr_html_()
    assert {"10.65", "10.25", "4.55"} <= set(text_of(html).split())
    assert "follow from its shape" in html and len(drawing_of(html).findall("{*}path")) > 5


def test_pad_file_that_cannot_be_drawn(tmp_path):
    """It says why, whatever the file is called."""
    broken, solid, gone = (tmp_path / name for name in ("<b>broken.stl", "a.step", "gone.ply"))
    for file in (broken, solid, gone):
        file.write_bytes(b"no such thing")
    pads = [PadFile(file) for file in (broken, solid, gone)]
    gone.unlink()
    texts = [text_of(pad._repr_html_()) for pad in pads]
    assert "<b>broken.stl" in texts[0] and "cannot be drawn: it is no STL" in texts[0]
    assert "known only after meshing" in texts[1] and "No such file" in texts[2]


def test_materials():
    words = text_of(Yeoh(0.1, 0.02, 0.003, 0.5)._repr_html_())
    assert "W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3" in words
    assert re.search(r"c20\s+0\.02\s+MPa", words) and re.search(r"shear_modulus \(derived\)\s+0\.2\s+MPa", words)
    assert re.search(r"compressibility \(derived\)\s+0\s+1/MPa", words)
    assert re.search(r"youngs_modulus\s+4\.16\s+MPa", text_of(NeoHookean()._repr_html_()))
    silicone = text_of(SILICONES["rtv_615"]._repr_html_())
    assert "doi:10.1089" in silicone and "50%" in silicone
    softened = text_of(Mullins(NeoHookean(), 2.5, 0.02, 0.1)._repr_html_())
    assert re.search(r"youngs_modulus\s+4\.16\s+MPa", softened) and re.search(r"m\s+0\.02\s+MPa", softened)


def test_law_of_a_user():
    @dataclass(frozen=True)
    class Own(NeoHookean):
        """W < infinity & more."""

    assert "W < infinity & more" in text_of(Own()._repr_html_())


def test_state():
    pad = Pad(rows=1, columns=1)
    rest, state = load_path(pad, NeoHookean(), [[0, 0, 0], [0, 0, -1]], mesh_size=1.6)
    largest = np.linalg.norm(state.displacement, axis=1).max()
    words = text_of(state._repr_html_())
    assert "0, 0, -1" in words and f"{largest:.5g}" in words and "force [N]" in words
    assert re.search(r"largest displacement \[mm\]\s+0\s", text_of(rest._repr_html_()))


def test_scene_and_sensor():
    words = text_of(Scene.from_file("pad.xml", cell="hemispheric", fz=-5)._repr_html_())
    assert re.search(r"cell\s+hemispheric\s+parallelepiped", words) and re.search(r"fz\s+-5\s+0", words)
    sensor = PadSensor(pad=Pad(rows=1, columns=2), force=(0, 0, -3))
    words = text_of(sensor._repr_html_())
    assert "(0, 0, -3) N" in words and "scattering = isotropic" in words and "NeoHookean" in words
    assert re.search(r"pad\s+deformable_pad", text_of(sensor.scene()._repr_html_()))


@pytest.mark.parametrize("taxels", [1, 9, 60])
def test_readings(taxels):
    """The beginning and the end of many."""
    power = 1e-3 * np.arange(1, taxels + 1)
    replicates = power * np.array([[0.99], [1.01]])
    deviation = np.full(taxels, np.nan)
    readings = Readings(replicates, 64, 7, deviation=deviation, remarks=["<i>mind</i> this"])
    html = readings._repr_html_()
    words = text_of(html)
    assert re.search(rf"\b{taxels}\s+{re.escape(f'{power[-1]:.6e}')}\s", words)
    assert f"{0.01 * power[0]:.1e}" in words  # of two at 1 % from their mean
    assert "2 randomisations of 64 points per taxel, seed 7" in words and "<i>mind</i> this" in words
    assert "light 1.00%, mechanics unknown, geometry 0.00%, total unknown" in words
    assert html.count("<tr>") == 1 + min(taxels, 21)


def a_study(values=(0.0, -1.0, -2.0), failures: str = "", taxels: int = 2) -> xr.Dataset:
    power = 1e-3 * (1 - 0.1 * np.array(values))[:, None, None] * np.linspace(0.99, 1.01, 4)[:, None] * np.ones(taxels)
    mean, error = power.mean(axis=1), power.std(axis=1, ddof=1) / 2
    dims = ["fz", "taxel"]
    return xr.Dataset(
        {
            "power": (dims, mean),
            "standard_error": (dims, error),
            "total_error": (dims, error),
            "replicate_power": (["fz", "replicate", "taxel"], power),
        },
        coords={"fz": np.array(values), "taxel": np.arange(1, taxels + 1)},
        attrs={"curve": "fz", "scene": "a<b>.xml", "notes": "all is well", "failures": failures},
    )


def picture_of(html: str) -> tuple[str, bytes]:
    kind, content = re.search('<img src="data:image/([a-z+]+);base64,([^"]+)" alt="[^"]{20,}"', html).groups()
    return kind, base64.b64decode(content)


@pytest.mark.usefixtures("painted_figures")
def test_study():
    html = show(a_study())._repr_html_()
    kind, picture = picture_of(html)
    assert kind == "svg+xml" and ElementTree.fromstring(picture).tag.endswith("svg")
    words = text_of(html)
    assert "a<b>.xml" in words and "all is well" in words and "failed" not in words
    assert "mean_slope_W_per_N" in words and "-1.000e-04" in words  # -0.1 of 1 mW for each N
    assert "light 0.43%, mechanics 0.00%, geometry 0.00%, total 0.43%" in words


@pytest.mark.usefixtures("painted_figures")
def test_study_behind_a_circuit():
    """0.1 mW for each N of 1 mW, on 1 kOhm behind 1 A/W: 1 V at rest, more than the limit of 1.15 V at -1.5 N."""
    circuit = Circuit(supply=1.15, load_resistance=1e3, transfer=1.0, saturation_voltage=0.0)
    words = text_of(show(with_volts(a_study(), circuit))._repr_html_())
    assert "mean_slope_W_per_N" in words and "mean_slope_counts_per_N" in words
    assert "-7.500e-02" in words and "-1.500e+00" in words  # V/N from 0 to -2 N; N


def test_study_of_several_scenes_with_failures():
    failures = "\n".join(f"fz=-{n}: it broke" for n in range(1, 15))
    tree = xr.DataTree.from_dict({"one": a_study(), "two": a_study(failures=failures)})
    words = text_of(show(tree)._repr_html_())
    assert "Study: one" in words and "Study: two" in words
    assert words.count("it broke") == 10 and "failed: 4 more" in words


@pytest.mark.usefixtures("painted_figures")
def test_large_study_is_no_svg():
    kind, picture = picture_of(show(a_study(np.linspace(0, -2, 100), taxels=51))._repr_html_())
    assert kind == "png" and picture.startswith(b"\x89PNG")


def test_plots_of_the_notebook_go_on():
    """A study's plot needs no screen, but leaves matplotlib as it was."""
    before = matplotlib.get_backend()
    matplotlib.use("svg")
    try:
        show(a_study())._repr_html_()
        assert matplotlib.get_backend() == "svg"
    finally:
        matplotlib.use(before)


@pytest.mark.parametrize("thing", [xr.Dataset(), "runs/hemi", None, xr.DataTree()])
def test_what_is_no_study_is_refused(thing):
    with pytest.raises(InputError, match="a result of sweep or open_study is needed"):
        show(thing)


def test_nothing_heavy_is_imported_for_it():
    """Until something is shown."""
    code = (
        "import sys, mitsuba_taxel as t; t.show; pad = t.Pad(); pad._repr_html_();"
        "print([name for name in ('matplotlib', 'xarray', 'pandas', 'trimesh') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "[]", done.stderr
    assert "show" in mitsuba_taxel.__all__
