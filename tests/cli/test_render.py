"""`taxel render`: what `--explain` says was left out, which was not even imported, and the table of `--derivatives`."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from one_cell import one_cell

HEAVY = {
    "dask", "distributed", "matplotlib", "meshio", "netgen", "OpenEXR", "pandas", "pytetwild", "rslab", "scipy",
    "trimesh", "xarray",
}  # fmt: skip
NO_PAD = "no pad: no mechanics imported, meshed or solved"
UNLOADED = "pad without load: meshed, nothing solved"
KEPT = "meshes and solutions found in the disk cache: nothing meshed or solved again"

PAD = one_cell(mesh_size=1.6, integrator="taxel_tracer", fz=0)
CYLINDER = one_cell(cell="cylindrical", mesh_size=1.7, scattering="$roof", fz=-0.5, roof="lambertian")


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """Run `taxel` in a fresh process: ``modules("render", ...)`` -> what it printed, and which modules it imported."""
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "kept"))
    (tmp_path / "pad.xml").write_text(PAD)
    code = "import sys, taxel_cli; taxel_cli.taxel(sys.argv[1:], standalone_mode=False); print(); print(*sys.modules)"

    def run(*words: object) -> tuple[dict, set[str]]:
        command = [sys.executable, "-c", code, *map(str, words)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300)
        answer, names = done.stdout.split("\n\n")
        return json.loads(answer), set(names.split())

    return run


def test_the_package_imports_mitsuba_and_nothing_else_heavy():
    code = "import sys, mitsuba_taxel; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = set(done.stdout.split())
    assert "mitsuba" in imported and not (HEAVY | {"click", "rich", "filelock"}) & imported
    assert not {name for name in imported if name.startswith(("mitsuba_taxel.mechanics", "mitsuba_taxel.studies"))}


def test_a_plate_imports_nothing_of_the_mechanics(modules):
    answer, imported = modules("render", "plate.xml", "--points", 64, "--explain", "--json")
    assert NO_PAD in answer["left_out"]
    assert not HEAVY & imported
    assert not {name for name in imported if name.startswith(("mitsuba_taxel.mechanics", "mitsuba_taxel.report"))}


def test_the_image_of_a_camera_imports_no_studies_and_no_mesher(modules, tmp_path):
    size = ("-D", "width=16", "-D", "height=12", "-D", "uz=0")
    answer, imported = modules("render", "gel.xml", "--points", 3, *size, "--json")
    assert answer["size"] == [16, 12] and answer["samples"] == 4 and 0.8 < answer["coat_share"] <= 1
    assert (tmp_path / "gel.exr").is_file() and (tmp_path / "gel.png").is_file()
    assert HEAVY & imported == {"OpenEXR", "scipy"}
    with pytest.raises(subprocess.CalledProcessError) as refused:
        modules("render", "gel.xml", *size, "--audit")
    assert "--audit is not allowed for the image of a camera" in refused.value.stderr
    with pytest.raises(subprocess.CalledProcessError) as refused:
        modules("render", "plate.xml", "--difference")
    assert "--difference is not allowed for readings" in refused.value.stderr


def test_a_pad_imports_what_its_load_needs(modules):
    """Unloaded it is meshed and not solved; once it is kept, it is not even meshed."""
    first, imported = modules("render", "pad.xml", "--points", 64, "--explain", "--json")
    assert UNLOADED in first["left_out"] and KEPT not in first["left_out"]
    assert HEAVY & imported == {"netgen", "scipy"}
    again, imported = modules("render", "pad.xml", "--points", 64, "--explain", "--json")
    assert KEPT in again["left_out"] and HEAVY & imported == {"scipy"}
    assert again["readings"] == first["readings"]
    loaded, imported = modules("render", "pad.xml", "-D", "fz=-0.2", "--points", 64, "--explain", "--json")
    assert UNLOADED not in loaded["left_out"] and HEAVY & imported == {"netgen", "rslab", "scipy"}
    assert not {"scipy.ndimage", "scipy.optimize", "scipy.stats"} & imported
    (solved,) = [line for line in loaded["left_out"] if line.startswith("symmetric pad and load")]
    assert "an eighth of the pad" in solved and "(0, 0, -0.2) N" in solved


def test_reasons_follow_the_readings(taxel):
    done = taxel("render", "plate.xml", "--points", 64, "--crosstalk", "--explain")
    assert done.returncode == 0 and done.stderr == ""
    _, _, matrix, reasons = done.stdout.split("\n\n")
    heading, *lines = reasons.splitlines()
    assert matrix.startswith("Crosstalk") and heading == "Left out of this scene:"
    assert f"  {NO_PAD}" in lines and "  irradiance map not requested: none accumulated" in lines


def test_a_map_is_not_left_out(taxel):
    done = taxel("render", "plate.xml", "--points", 64, "-o", "map.exr", "--explain", "--json")
    assert not any("irradiance" in line for line in json.loads(done.stdout)["left_out"])


def test_without_the_option_nothing_is_said(taxel):
    assert "left_out" not in json.loads(taxel("render", "plate.xml", "--points", 64, "--json").stdout)


@pytest.fixture
def of_cylinder(taxel, tmp_path):
    """`taxel` beside a cylindrical cell."""
    (tmp_path / "pad.xml").write_text(CYLINDER)
    return taxel


def test_json_and_table_of_derivatives_say_the_same(of_cylinder):
    words = "render", "pad.xml", "--points", 16, "--derivatives", "fz, spacing"
    rows = json.loads(of_cylinder(*words, "--json").stdout)["derivatives"]
    assert [(row["taxel"], row["parameter"], row["unit"]) for row in rows] == [(1, "fz", "W/N"), (1, "spacing", "W/mm")]
    assert all(0 < row["standard_error"] < 0.1 * abs(row["value"]) for row in rows)
    assert {row["method"] for row in rows} == {"without random numbers"}
    table = of_cylinder(*words).stdout
    assert "Derivatives of the readings (without random numbers), +- standard error" in table and "fz [W/N]" in table
    assert all(f"{row['value']:.4e} +- {row['standard_error']:.0e}" in table for row in rows)


def test_mirrors_have_derivatives_by_random_paths(of_cylinder):
    words = "render", "pad.xml", "--points", 16, "--derivatives", "spacing", "-D", "roof=mirror", "-D", "fz=0"
    (row,) = json.loads(of_cylinder(*words, "--json").stdout)["derivatives"]
    assert row["method"] == "differences of random paths" and row["standard_error"] > 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--derivatives", "roof"), "roof = 'lambertian' has no derivative: it is not a number."),
        (
            ("--derivatives", "hight"),
            "hight has no derivative: it is not a numeric parameter of the scene. Allowed are parameters fz; "
            "numbers of its parts cell_height, cell_size, ",
        ),
    ],
)
def test_what_has_no_derivative_is_refused_in_one_line(words, said, of_cylinder):
    done = of_cylinder("render", "pad.xml", "--points", 16, *words)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1


def test_a_sweep_takes_its_slopes_from_derivatives(of_cylinder, tmp_path):
    words = "sweep", "pad.xml", "--vary", "fz=0:-0.5:-0.5", "--points", 16, "--derivatives", "fz,spacing", "-o", "out"
    done = of_cylinder(*words, "--json")
    (row,) = json.loads(done.stdout)["sensitivity"]
    from mitsuba_taxel import open_study

    study = open_study(tmp_path / "out").squeeze("taxel")
    at = study.derivative.sel(parameter="fz")
    assert row["zero_slope_W_per_N"] == pytest.approx(float(at.sel(fz=0)))
    assert abs(row["max_slope_W_per_N"]) >= float(abs(at).max()) and row["max_slope_error_W_per_N"] > 0
    said = of_cylinder("characterise", "out", "-o", "figures").stdout
    assert "Slopes: from derivatives, without random numbers" in said
    assert study.derivative_unit.values.tolist() == ["W/N", "W/mm"]
