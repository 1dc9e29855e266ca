"""The page of a study holds all of it, needs nothing else, and shows the pad as it is."""

from __future__ import annotations

import base64
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr

from mitsuba_taxel import Circuit, InputError, open_study, sweep
from mitsuba_taxel.characterise import volts_table
from mitsuba_taxel.characterise.wording import figure_rows
from mitsuba_taxel.electronics import with_volts
from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.report.page import light, panels, sections, study_page, write_report
from mitsuba_taxel.report.page.coarsening import coarsened
from mitsuba_taxel.report.page.markup import paragraph, table
from mitsuba_taxel.report.page.solids import ArrayEncoding
from mitsuba_taxel.studies import study_error_budget


def box(pieces):
    """A closed cube of edge 2 mm, each face with ``pieces`` cut along it, and a region for each of its six faces."""
    mesh = trimesh.creation.box((2, 2, 2))
    for _ in range(pieces):
        mesh = mesh.subdivide()
    normals = np.round(mesh.face_normals).astype(int)
    return mesh, 1 + np.array([3 * (normal.sum() > 0) + int(np.argmax(np.abs(normal))) for normal in normals])


@pytest.mark.parametrize("most", [100, 500, 3000])
def test_a_coarser_surface_keeps_rims_volume_and_regions(most):
    mesh, regions = box(5)
    kept, triangles, kinds = coarsened(mesh.vertices, mesh.faces, regions, most)
    assert 8 <= len(kept) <= most < len(mesh.vertices)
    coarse = trimesh.Trimesh(mesh.vertices[kept], triangles, process=False)
    assert coarse.is_watertight and coarse.volume == pytest.approx(8.0, rel=1e-9)
    normals = np.round(coarse.face_normals[coarse.area_faces > 1e-9]).astype(int)
    of = 1 + np.array([3 * (normal.sum() > 0) + int(np.argmax(np.abs(normal))) for normal in normals])
    assert np.array_equal(of, kinds[coarse.area_faces > 1e-9])


def test_the_same_material_points_are_shown_of_a_deformed_surface():
    mesh, regions = box(4)
    kept, triangles, _ = coarsened(mesh.vertices, mesh.faces, regions, 300)
    moved = mesh.vertices * (1.1, 1.0, 0.7)
    assert trimesh.Trimesh(moved[kept], triangles, process=False).volume == pytest.approx(8.0 * 1.1 * 0.7, rel=1e-9)


BALL = """<scene version="3.9.0">
    <default name="depth" value="0.3"/> <integrator type="taxel_tracer"/>
    <shape type="deformable_pad">
        <string name="cell" value="hemispheric"/> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="mesh_size" value="2"/> <integer name="subdivision" value="4"/>
        <string name="load" value="indenter_displacement"/> <vector name="displacement" value="0, 0, -$depth"/>
        <string name="indenter" value="sphere"/> <float name="indenter_radius" value="2"/>
        <bsdf type="region"> <bsdf name="roof" type="wall"/> </bsdf>
    </shape>
    <shape type="photo_reflector">
        <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <emitter type="annular_led"/> <sensor type="phototransistor"/>
    </shape>
</scene>"""


def solids(page):
    text = re.search(r'<script type="application/json" id="solids">(.*?)</script>', page.read_text(), re.DOTALL)[1]
    return json.loads(text)["panels"]


@pytest.mark.parametrize("most", [300, 1200])
def test_no_triangle_is_folded_over(study_folder, most):
    from mitsuba_taxel.report.page.solids import read_surfaces

    surface = read_surfaces(sorted((study_folder / "meshes").glob("*.ply"))[:1])
    coarse = coarsened(*surface[:3], most_vertices=most)
    upwards = area_normals(surface.vertices[coarse.kept], coarse.triangles)[:, 2]
    for name, sign in {"roof": -1, "bottom": -1, "top": 1}.items():  # these lie flat
        there = coarse.regions == REGIONS[name]
        assert there.any() and np.all(sign * upwards[there] > -1e-9)


def numbers(packed, kind):
    return np.frombuffer(base64.b64decode(packed), dtype=kind).reshape(-1, 3)


def test_scenes_of_a_table_have_the_values_of_its_rows(monkeypatch):
    """As of tolerances: a row has a number, which is no parameter of the scene."""
    where = {"step": [1, 2], "fz": [0, -1], "spacing": ("step", [0.8, 0.9])}
    files = xr.DataArray([["a", "b"], ["c", "d"]], dims=("step", "fz"), coords=where)
    study = xr.Dataset({"mesh": files}, attrs={"curve": "fz"})
    monkeypatch.setattr(panels, "_panel", lambda where, row, steps, *_: {"where": where, "row": row, "steps": steps})
    shown = panels.viewer_panels(study, Path(), None, 9, [], lambda *_: None)
    assert [panel["where"] for panel in shown] == [{"step": "1"}, {"step": "2"}]
    assert [panel["row"] for panel in shown] == [{"spacing": "0.8"}, {"spacing": "0.9"}]


def test_the_viewer_gets_the_pads_of_the_study(page, study_folder):
    study = open_study(study_folder)
    panels = solids(page)
    assert [panel["name"] for panel in panels] == ["cell = parallelepiped", "cell = cylindrical"]
    for panel in panels:
        cell = panel["name"].removeprefix("cell = ")
        assert [step["words"] for step in panel["steps"]] == ["fz = 0 N", "fz = -0.5 N", "fz = -1 N"]
        for force, step in zip((0, -0.5, -1), panel["steps"], strict=True):
            pad = trimesh.load(study_folder / study.mesh.sel(cell=cell, fz=force).item(), process=False)
            vertices = numbers(step["vertices"], "<i2") * panel["unit"]
            triangles = numbers(panel["topologies"][step["topology"]]["triangles"], "<u2")
            shown = trimesh.Trimesh(vertices, triangles, process=False)
            assert shown.bounds == pytest.approx(pad.bounds, abs=2 * panel["unit"])
            assert shown.volume == pytest.approx(pad.volume, rel=0.02)
        rest = trimesh.load(study_folder / study.mesh.sel(cell=cell, fz=0).item(), process=False)
        pressed = trimesh.load(study_folder / study.mesh.sel(cell=cell, fz=-1).item(), process=False)
        largest = np.linalg.norm(rest.vertices - pressed.vertices, axis=1).max()
        assert panel["rest"] == 0 and panel["most"] == pytest.approx(largest, rel=0.01)


def test_light_paths_run_from_the_led_to_the_phototransistor_of_the_cell_that_is_cut(page):
    for panel in solids(page):
        faces = {
            kind: [
                numbers(solid["vertices"], "<i2") * panel["unit"] for solid in panel["fixed"] if solid["kind"] == kind
            ]
            for kind in ("led", "phototransistor", "board", "other")
        }
        assert [len(found) for found in faces.values()] == [2, 2, 1, 2]
        led, phototransistor = (faces[kind][panel["taxel"] - 1] for kind in ("led", "phototransistor"))
        for step in panel["steps"]:
            assert step["rays"]["reached"] and step["rays"]["others"]
            for path in step["rays"]["reached"]:
                start, end = (numbers(path, "<i2") * panel["unit"])[[0, -1]]
                for point, face in ((start, led), (end, phototransistor)):
                    assert np.all(point > face.min(axis=0) - 0.02) and np.all(point < face.max(axis=0) + 0.02)


@pytest.fixture(scope="module")
def pressed_page(tmp_path_factory, mechanics_error_unknown):
    """Of a cell that a ball presses on."""
    folder = tmp_path_factory.mktemp("pressed")
    (folder / "ball.xml").write_text(BALL)
    sweep(folder / "ball.xml", {"depth": "0,0.3"}, points=64, output=folder / "results")
    assert write_report(folder / "results", folder / "report.html") == []
    return folder / "report.html"


def test_indenters_are_drawn_and_what_they_press_with_has_colours(pressed_page):
    (panel,) = solids(pressed_page)
    assert panel["cut"] == 0
    for step, depth in zip(panel["steps"], (0, 0.3), strict=True):
        vertices = numbers(step["vertices"], "<i2") * panel["unit"]
        pressure = np.frombuffer(base64.b64decode(step["pressure"]), np.uint8) * panel["pressure"] / 255
        assert len(pressure) == len(vertices) and pressure.any() == bool(depth)
        assert np.all(np.linalg.norm(vertices[pressure > 0] - [0, 0, 4.55], axis=1) < 1.3)
        (ball,) = step["indenters"]
        places = numbers(ball["vertices"], "<i2") * panel["unit"]
        assert np.linalg.norm(places[:-2] - [0, 0, 4.55 - depth + 2.0], axis=1) == pytest.approx(2.0, abs=0.01)
        low, high = np.array(panel["frame"])
        assert (places > low - 0.01).all() and (places < high + 0.01).all()
    assert high[2] == pytest.approx(8.55, abs=0.01) and panel["box"][1][2] == pytest.approx(4.55, abs=0.01)


class Checker(HTMLParser):
    """Collects what a page would fetch, its pictures, and whether its tags match."""

    EMPTY = ("meta", "link", "img", "input", "br", "source")

    def __init__(self):
        super().__init__()
        self.open, self.fetched, self.alternatives, self.ids = [], [], [], []

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if tag not in self.EMPTY:
            self.open.append(tag)
        self.ids += [attrs["id"]] if "id" in attrs else []
        self.fetched += [attrs[name] for name in ("src", "srcset", "href") if name in attrs]
        self.alternatives += [attrs.get("alt")] if tag == "img" else []

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_no_network(page):
    text = page.read_text()
    checker = Checker()
    checker.feed(text)
    assert checker.open == [] and len(set(checker.ids)) == len(checker.ids)
    assert all(target.startswith(("data:", "#")) for target in checker.fetched)
    assert {target[1:] for target in checker.fetched if target.startswith("#")} <= set(checker.ids)
    assert not re.search(r"url\(|@import|fetch\(|XMLHttp", text)
    assert len(checker.alternatives) == 5 and all(len(words) > 40 for words in checker.alternatives)


def test_the_page_says_what_the_study_says(page, study_folder):
    text, study = page.read_text(), open_study(study_folder)
    assert "one &amp; two.xml" in text and "one & two.xml" not in text
    assert "cell: parallelepiped, cylindrical" in text and "fz: 3 values from 0 to -1 N" in text
    budget = study_error_budget(study)
    assert all(f"<td>{source}</td><td>{share:.2%}</td>" in text for source, share in budget.items())
    assert all(
        word in text
        for word in ("mechanics", "total", "optics", "max slope [µW/N]", "relative slope [%/N]", "nonlinearity [%]")
    )
    assert json.loads(study.attrs["versions"])["mitsuba"] in text


def test_behind_a_circuit_the_page_says_it_in_volts_too(study_folder):
    """The numbers of the tables that `taxel characterise` writes."""
    circuit = Circuit(supply=3.3, load_resistance=1e3, transfer=0.1)
    study = with_volts(open_study(study_folder), circuit)
    text = sections.power(study, "") + sections.merit(study, "")
    volts = volts_table(study, circuit)
    for reading in ("W", "V"):
        assert f"Sensitivities of readings in {reading}" in text
    headings, rows = figure_rows(volts)
    assert "mean slope [counts/N]" in headings and all(f"<td>{cell}</td>" in text for row in rows for cell in row)
    assert f"<td>{int(study.counts.values.flat[0])}</td>" in text and "voltage [mV]" in text


def test_what_a_study_says_is_not_taken_for_html():
    assert paragraph("<script>") == "<p>&lt;script&gt;</p>"
    assert "<b>" not in table("<b>", ["<b>"], [["<b>"]])


def test_without_its_scene_the_page_shows_the_pad_without_light(study_folder, tmp_path):
    moved = tmp_path / "results"
    shutil.copytree(study_folder, moved)
    study = moved / "study.toml"
    study.write_text(study.read_text().replace("one & two.xml", "gone.xml"))
    (left_out,) = write_report(moved, tmp_path / "page.html")
    assert left_out.startswith("light paths and packages") and "does not exist" in left_out
    panels = solids(tmp_path / "page.html")
    assert len(panels) == 2 and not any("rays" in step for panel in panels for step in panel["steps"])
    assert "Left out: light paths" in (tmp_path / "page.html").read_text()


def test_a_scene_that_was_changed_since_shows_no_light(study_folder, tmp_path):
    scene = study_folder.parent / "one & two.xml"
    before = scene.read_text()
    try:
        scene.write_text(before.replace('"0, 0, $fz"', '"0, 0.1, $fz"'))
        (left_out,) = write_report(study_folder, tmp_path / "page.html")
    finally:
        scene.write_text(before)
    assert left_out.endswith("has been changed since.")


def test_what_is_not_drawn_is_said(study_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "MOST_STEPS", 2)
    monkeypatch.setattr(study_page, "MOST_PANELS", 1)
    pads, steps = write_report(study_folder, tmp_path / "page.html")
    assert pads.startswith("1 of 2 pads") and "of which 2 of each pad" in steps
    (panel,) = solids(tmp_path / "page.html")
    assert [step["words"] for step in panel["steps"]] == ["fz = 0 N", "fz = -1 N"]


def test_long_tables_are_cut(study_folder, monkeypatch):
    study = open_study(study_folder)
    monkeypatch.setattr(sections, "MOST_ROWS", 3)
    for text, rest in ((sections.power(study, ""), "12: readings.csv"), (sections.merit(study, ""), "4: taxel")):
        tables = text.split("<caption>")[1:]
        assert any(f"(the first 3 of {rest}" in one for one in tables)
        assert all(one.split("</table>")[0].count("<tr>") <= 4 for one in tables)


def test_pads_that_failed_take_no_place(study_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(study_page, "MOST_PANELS", 1)
    study = open_study(study_folder)
    study.mesh[{"cell": 0}] = ""
    monkeypatch.setattr(study_page, "open_study", lambda folder: study)
    assert write_report(study_folder, tmp_path / "page.html") == []
    assert [panel["name"] for panel in solids(tmp_path / "page.html")] == ["cell = cylindrical"]


def test_no_displacement_is_stated_between_different_pads(study_folder, tmp_path):
    from mitsuba_taxel import sweep

    sweep(
        study_folder.parent / "one & two.xml",
        {"cell": "parallelepiped,cylindrical"},
        points=64,
        output=tmp_path / "cells",
    )
    write_report(tmp_path / "cells", tmp_path / "page.html")
    (panel,) = solids(tmp_path / "page.html")
    assert [step["words"] for step in panel["steps"]] == ["cell = parallelepiped", "cell = cylindrical"]
    assert [step["largest"] for step in panel["steps"]] == ["0", None] and panel["most"] == 0


def test_a_step_without_light_paths_says_why(study_folder, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise InputError("no light today.")

    monkeypatch.setattr(light, "sample_paths", refuse)
    assert write_report(study_folder, tmp_path / "page.html") == ["light paths: no light today."]


def test_meshes_beside_the_pad_fit_into_16_bits(tmp_path, llvm_mono):
    from mitsuba_taxel import PhotoReflector, Scene

    ball = trimesh.creation.icosphere(subdivisions=6, radius=2)
    corners = ball.vertices[ball.faces].reshape(-1, 3) + [0, 0, 4]
    assert len(corners) > 65536
    trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False).export(tmp_path / "ball.ply")
    parts = {"reflector": PhotoReflector().to_dict(), "ball": {"type": "ply", "filename": str(tmp_path / "ball.ply")}}
    live = Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, **parts}).load()
    box = np.array([[-3.0, -3, 0], [3, 3, 7]])
    packing = ArrayEncoding(8.0)
    fixed = light.LitScene(live, box).fixed(packing)
    assert [solid["kind"] for solid in fixed] == ["other", "other", "led", "phototransistor"]
    shown = trimesh.Trimesh(
        numbers(fixed[1]["vertices"], "<i2") * packing.unit, numbers(fixed[1]["triangles"], "<u2"), process=False
    )
    assert shown.volume == pytest.approx(4 / 3 * np.pi * 8, rel=0.02) and shown.bounds[1, 2] == pytest.approx(
        6, abs=0.05
    )


def test_a_study_without_a_pad_has_no_viewer(tmp_path):
    from mitsuba_taxel import sweep

    sweep("plate.xml", {"z": "0.5,0.7"}, points=64, output=tmp_path / "plate")
    (left_out,) = write_report(tmp_path / "plate", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert "no meshes" in left_out and 'id="viewer"' not in text and 'id="power"' in text and 'id="merit"' not in text


def test_scenes_of_one_study_share_a_page(study_folder, tmp_path):
    from mitsuba_taxel import run_study

    file = tmp_path / "two.toml"
    file.write_text(
        'points = 64\n[[scenes]]\nname = "near"\nscene = "plate.xml"\nvary = {z = [0.5, 0.7]}\n'
        '[[scenes]]\nname = "far"\nscene = "plate.xml"\nvary = {z = [1.0]}\n'
    )
    run_study(file, tmp_path / "two")
    assert len(write_report(tmp_path / "two", tmp_path / "page.html")) == 2
    checker = Checker()
    checker.feed((tmp_path / "page.html").read_text())
    assert {"power-near", "power-far", "cost-near", "about-far"} <= set(checker.ids)


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(InputError, match="study.toml"):
        write_report(tmp_path, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
