"""`pad.xml`: light in the cells of undeformed and deformed pads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edited_pad import TWO_CELLS, edited

from mitsuba_taxel import (
    AnnularLed,
    Indenter,
    IndenterDisplacement,
    InputError,
    Pad,
    PadSensor,
    PhotoReflector,
    Scene,
    Wall,
    measure,
)
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

CELLS = ("parallelepiped", "cylindrical", "spherical", "hemispheric")


@pytest.mark.parametrize("region", ["top", "outer"])
def test_light_must_not_leave_a_pad_to_an_indenter(llvm_mono, tmp_path, region):
    load = """<string name="load" value="indenter_displacement"/> <float name="indenter_radius" value="2"/>
        <vector name="displacement" value="$fx, $fy, $fz"/> <bsdf type="region"> <bsdf name="REGION" type="null"/>"""
    force = '<vector name="force" value="$fx, $fy, $fz"/>\n        <bsdf type="region">'
    path = edited(tmp_path, "clear.xml", (force, load.replace("REGION", region)))
    with pytest.raises(InputError, match=f"bsdf {region} of a pad under an indenter is not allowed: it lets light"):
        prepare(path)


@pytest.mark.parametrize("spacing, hole", [(0.9, 0.1), (0.6, 0.0)])
def test_flat_absorbing_cell_matches_quadrature(llvm_mono, agree, spacing, hole):
    """One bounce off an isotropic square roof: no light comes from anywhere else."""
    reading = measure(Scene.from_file("pad.xml", spacing=spacing, hole=hole), points=1 << 11, seed=2)
    expected = one_bounce(spacing, hole, side=2.55, height=1.05)
    agree(reading.power, reading.standard_error, np.full(9, expected))


def one_bounce(spacing, hole, side, height, n=48):
    """LED with the 88-degree cone under an isotropic roof of reflectance 1, by Gauss-Legendre quadrature."""

    def rectangle(side_x, side_y, count):
        nodes, weights = np.polynomial.legendre.leggauss(count)
        x, y = np.meshgrid(0.5 * side_x * nodes, 0.5 * side_y * nodes)
        return x.ravel(), y.ravel(), np.outer(weights, weights).ravel() * 0.25 * side_x * side_y

    roof_x, roof_y, roof_w = rectangle(side, side, n)

    def irradiation(source_side):
        """Integral over a square source of the power per area that arrives at each point of the roof."""
        if source_side == 0:
            return 0.0
        x, y, w = rectangle(source_side, source_side, 12)
        d2 = (roof_x[:, None] + 0.5 * spacing - x) ** 2 + (roof_y[:, None] - y) ** 2 + height**2
        cosine = height / np.sqrt(d2)
        limit = np.cos(np.radians(88))
        return ((cosine > limit) / (2 * np.pi * (1 - limit)) * cosine / d2) @ w

    arriving = (irradiation(0.25) - irradiation(hole)) / (0.25**2 - hole**2)
    x, y, w = rectangle(0.52, 0.3, 12)
    d2 = (roof_x[:, None] - 0.5 * spacing - x) ** 2 + (roof_y[:, None] - y) ** 2 + height**2
    received = (height / d2**1.5 / (2 * np.pi)) @ w  # isotropic: 1 / (2 pi) per solid angle
    return roof_w @ (arriving * received)


@pytest.mark.parametrize("cell", ["parallelepiped", "spherical"])
def test_cells_of_an_undeformed_pad_read_alike(llvm_mono, agree, cell):
    reading = measure(Scene.from_file("pad.xml", cell=cell), points=1 << 9, seed=8)
    mean = reading.power.mean()
    agree(reading.power, reading.standard_error, np.full(9, mean), reading.standard_error / 3)


@pytest.mark.parametrize("cell, fz", [("parallelepiped", -2.5), ("hemispheric", -2.5)])
def test_stock_path_agrees_on_lambertian_walls(llvm_mono, agree, tmp_path, cell, fz):
    """Every wall reflects, many bounces, a deformed pad: Mitsuba's own path tracer from the other end."""
    walls = (
        '<bsdf name="roof" type="wall">\n'
        '                <string name="scattering" value="$scattering"/>\n'
        "            </bsdf>",
        '<bsdf name="roof" type="wall"> <float name="reflectance" value="0.9"/> </bsdf>'
        '<bsdf name="side" type="wall"> <float name="reflectance" value="0.4"/> </bsdf>',
    )
    unused = ('<default name="scattering" value="isotropic"/>', "")
    integrator = ('type="taxel_tracer"', 'type="path"')
    values = dict(cell=cell, fz=fz, law="lambertian")
    scene = Scene.from_file(edited(tmp_path, "ours.xml", walls, unused, *TWO_CELLS), **values)
    stock = Scene.from_file(edited(tmp_path, "path.xml", walls, unused, integrator, *TWO_CELLS), **values)
    ours = measure(scene, points=1024, mechanics_error=False)
    theirs = measure(stock, points=512, mechanics_error=False)
    assert theirs.relative_error < 0.02
    agree(theirs.power, theirs.standard_error, ours.power, ours.standard_error)


@pytest.mark.parametrize("cell", ["parallelepiped", "hemispheric"])
def test_exported_mesh_in_a_plain_scene_reads_the_same(llvm_mono, tmp_path, agree, cell):
    """To the bit where paths are not guided; those in domes are, after the pad at rest, which a mesh does not know."""
    mi = llvm_mono
    two_cells = edited(tmp_path, "two.xml", *TWO_CELLS)
    live = Scene.from_file(two_cells, cell=cell, fz=-1.5).load()
    pad = next(shape for shape in live.shapes() if hasattr(shape, "pad"))
    pad.write_ply(str(tmp_path / "pad.ply"))
    rest = two_cells.read_text()
    start, end = rest.index('<shape type="deformable_pad">'), rest.index('<bsdf type="region">')
    ply = '<shape type="ply"><string name="filename" value="pad.ply"/><boolean name="face_normals" value="true"/>'
    text = rest[:start] + ply + rest[end:]
    for name in ("cell", "fx", "fy", "fz", "youngs_modulus", "poisson_ratio", "prony", "mullins", "history", "time"):
        text = "\n".join(line for line in text.splitlines() if f'<default name="{name}"' not in line)
    (tmp_path / "plain.xml").write_text(text)
    before = measure(live, points=512, mechanics_error=False)
    for plain in (mi.load_file(str(tmp_path / "plain.xml")), Scene.from_file(tmp_path / "plain.xml")):
        after = measure(plain, points=512)
        if cell == "parallelepiped":
            assert np.array_equal(after.replicates, before.replicates)
        else:
            agree(after.power, after.standard_error, before.power, before.standard_error)


def test_scene_from_python_written_as_xml_reads_the_same_to_the_bit(llvm_mono, tmp_path):
    sensor = PadSensor(
        pad=Pad(cell="hemispheric", rows=1, columns=2, pitch=3.7),
        photo_reflector=PhotoReflector(led=AnnularLed(law="lambertian"), spacing=0.8),
        force=(0.5, 0, -1 / 3),
        roof=Wall("lambertian", 0.9),
    )
    scene = sensor.scene()
    scene.write_xml(tmp_path / "sensor.xml")
    reloaded = Scene.from_file(tmp_path / "sensor.xml")
    coarse = (scene.with_mesh_size(2.0) for scene in (scene, reloaded))
    ours, theirs = (measure(s, points=256, seed=4, mechanics_error=False) for s in coarse)
    assert ours.power.shape == (2,)
    assert np.array_equal(ours.replicates, theirs.replicates)


@pytest.mark.parametrize("cell", ["cylindrical", "hemispheric"])
def test_finer_roofs_change_readings_by_less_than_a_thousandth(llvm_mono, agree, tmp_path, cell):
    """Twice as fine as the default: the change is within 0.1 %, as far as the light's noise lets one see."""
    finer = (
        '<string name="cell" value="$cell"/>',
        '<string name="cell" value="$cell"/><integer name="subdivision" value="24"/>',
    )
    two_bounces = (
        'type="taxel_tracer"/>',
        'type="taxel_tracer"><integer name="max_depth" value="2"/></integrator>',
    )
    values = dict(cell=cell, fz=-2.5)
    scene = Scene.from_file(edited(tmp_path, "default.xml", two_bounces, *TWO_CELLS), **values)
    subdivided = Scene.from_file(edited(tmp_path, "finer.xml", two_bounces, finer, *TWO_CELLS), **values)
    default = measure(scene, points=1 << 12, mechanics_error=False)
    fine = measure(subdivided, points=1 << 12, mechanics_error=False)
    change = (fine.replicates - default.replicates).mean(axis=1) / default.power.mean()
    error = change.std(ddof=1) / np.sqrt(len(change))
    assert error < 5e-4
    assert abs(change.mean()) < 1e-3 + 4 * error


def test_same_bits_every_time_whatever_the_threads(llvm_mono):
    import drjit as dr

    scene = Scene.from_file("pad.xml", cell="cylindrical").load()
    readings = []
    threads = dr.thread_count()
    try:
        for count in (1, 2, 2):
            dr.set_thread_count(count)
            readings.append(measure(scene, points=256, seed=1, mechanics_error=False).replicates)
    finally:
        dr.set_thread_count(threads)
    assert np.array_equal(readings[0], readings[1]) and np.array_equal(readings[1], readings[2])


def test_mono_and_rgb_read_the_same(llvm_mono):
    mi = llvm_mono
    readings = {}
    for variant in ("llvm_ad_mono", "llvm_ad_rgb"):
        mi.set_variant(variant)
        readings[variant] = measure(Scene.from_file("pad.xml", cell="spherical"), points=256, seed=1).power
    assert readings["llvm_ad_rgb"] == pytest.approx(readings["llvm_ad_mono"], rel=1e-5)


@pytest.mark.parametrize("optimize", [True, False])
def test_plain_loading_of_several_pads_at_once(llvm_mono, optimize):
    """Mitsuba builds plugins in parallel threads and merges what looks alike; neither must harm."""
    mi = llvm_mono
    shift = mi.ScalarTransform4f().translate([40, 0, 0])
    pad = {"type": "deformable_pad", "rows": 1, "columns": 1, "force": [0, 0, -0.3]}
    reflector = {
        "type": "photo_reflector",
        "led": {"type": "annular_led"},
        "detector": {"type": "phototransistor"},
    }
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer"},
            "a": {**pad, "walls": {"type": "region", "roof": {"type": "wall"}}},
            "b": {
                **pad,
                "cell": "cylindrical",
                "to_world": shift,
                "walls": {"type": "region", "roof": {"type": "wall"}},
            },
            "c": reflector,
            "d": {**reflector, "to_world": shift, "detector": {"type": "phototransistor", "width": 0.5}},
        },
        optimize=optimize,
    )
    reading = measure(scene, points=1024)
    assert reading.power.shape == (2,) and np.all(reading.power > 1e-3)
    assert reading.power[0] != reading.power[1]


@pytest.mark.parametrize(("x", "notes"), [(0.0, []), (9.0, ["a pad is at rest: its indenter does not touch it"])])
def test_an_indenter_that_misses_the_pad_is_told(llvm_mono, x, notes):
    sensor = PadSensor(
        Pad("cylindrical", 1, 1),
        load=IndenterDisplacement(Indenter("sphere", radius=0.8, at=(x, 0.0))),
        force=(0, 0, -0.1),
    )
    ready = prepare(sensor.scene().with_mesh_size(1.7))
    assert [note for note in ready.notes if "indenter" in note] == notes


def test_a_buckled_pad_is_told(llvm_mono):
    ready = prepare(PadSensor(Pad("cylindrical", 1, 1), force=(0, 0, -0.1)).scene().with_mesh_size(1.7))
    assert not any("buckled" in note for note in ready.notes)
    (pad,) = deformed_pads(ready.scene)
    pad.state = replace(pad.state, buckled_at=np.array([0, 0, -0.05]))
    notes = prepare(ready.scene).notes
    assert "a pad has buckled at (0, 0, -0.05) N: one of its mirror-image shapes is followed" in notes
