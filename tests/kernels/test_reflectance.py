"""Reflectances of walls from tables, at the wavelength of the light."""

from __future__ import annotations

import pytest
from wall_laws import context, direction, draw, interaction

from mitsuba_taxel import InputError, Scene


@pytest.fixture
def table(tmp_path):
    """A file with the reflectances of a wall that gets darker, with all that a table may hold besides."""
    path = tmp_path / "paint.csv"
    path.write_text("# nm, reflectance\n900, 0.8\n\n925, 0.7  # measured\n1000, 0.1\n")
    return str(path)


@pytest.mark.parametrize("nm, reflectance", [(900, 0.8), (905, 0.78), (925, 0.7), (950, 0.5), (1000, 0.1)])
def test_table_is_interpolated(llvm_mono, table, nm, reflectance):
    mi = llvm_mono
    bsdf = mi.load_dict({"type": "wall", "reflectance_table": table})
    assert bsdf.needs_wavelength and "not known yet" in str(bsdf)
    bsdf.set_wavelength(nm)
    assert draw(mi, bsdf, "Importance", direction(20), 4)[1] == pytest.approx(reflectance)
    assert bsdf.needs_wavelength


def test_table_is_found_beside_the_scene(llvm_mono, table, tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.9.0"> <shape type="sphere"> <bsdf type="wall">'
        '<string name="reflectance_table" value="paint.csv"/> </bsdf> </shape> </scene>'
    )
    assert Scene.from_file(path).load().shapes()[0].bsdf().needs_wavelength


def test_a_wall_with_a_table_waits_for_the_wavelength(llvm_mono, table):
    mi = llvm_mono
    bsdf = mi.load_dict({"type": "wall", "reflectance_table": table})
    ctx, si, wo = context(mi, "Importance"), interaction(mi, direction(20)), mi.Vector3f(0, 0, 1)
    for call in (
        lambda: bsdf.sample(ctx, si, 0.5, mi.Point2f(0.5)),
        lambda: bsdf.eval(ctx, si, wo),
        lambda: bsdf.pdf(ctx, si, wo),
        lambda: bsdf.eval_pdf(ctx, si, wo),
        lambda: bsdf.eval_diffuse_reflectance(si),
    ):
        with pytest.raises(InputError, match="reflectance_table needs the wavelength .* only mitsuba_taxel sets"):
            call()
    with pytest.raises(InputError, match=r"paint.csv' has no .* wavelength of 850 nm: it covers 900 to 1000 nm"):
        bsdf.set_wavelength(850.0)
    with pytest.raises(InputError, match="wavelength of nan nm"):
        bsdf.set_wavelength(float("nan"))


def test_region_passes_the_wavelength_on(llvm_mono, table):
    mi = llvm_mono
    tabulated, plain = {"type": "wall", "reflectance_table": table}, {"type": "wall", "reflectance": 0.3}
    stock = {"type": "diffuse"}
    assert not mi.load_dict({"type": "region", "roof": plain, "side": stock}).needs_wavelength
    region = mi.load_dict({"type": "region", "roof": tabulated, "side": plain, "bottom": stock, "led": tabulated})
    assert region.needs_wavelength and not region.walls["side"].needs_wavelength
    region.set_wavelength(950)
    assert region.walls["roof"].reflectance[0] == region.walls["led"].reflectance[0] == pytest.approx(0.5)
    assert region.walls["side"].reflectance[0] == pytest.approx(0.3)


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "0 rows"),
        ("900, 0.5, 1\n", "row 1 is not allowed: two columns"),
        ("nm, reflectance\n900, half\n", "row 1 is not allowed: two columns of numbers are needed"),
        ("900, 0.5\n900, 0.6\n", "row 2, 900, 0.6, is not allowed"),
        ("900, 1.5\n", "row 1, 900, 1.5, is not allowed"),
        ("900, nan\n", "row 1, 900, nan, is not allowed"),
        ("900, 0.5\ninf, 0.5\n", "row 2, inf, 0.5, is not allowed"),
        ("-900, 0.5\n", "row 1, -900, 0.5, is not allowed"),
    ],
)
def test_bad_tables_are_refused(llvm_mono, tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    scene = Scene({"type": "scene", "s": {"type": "sphere", "b": {"type": "wall", "reflectance_table": str(path)}}})
    with pytest.raises(InputError, match=message) as caught:
        scene.load()
    assert "\n" not in str(caught.value) and "reflectance_table" in str(caught.value)
