"""Optimisations through the whole chain, whose answer is known."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from one_cell import one_cell
from plate_reference import plate_power
from scipy.optimize import minimize_scalar
from taxel_program import run_program

from mitsuba_taxel import InputError, Pad, PadSensor, Scene, Wall, measure, open_study
from mitsuba_taxel.optimum import optimise
from mitsuba_taxel.optimum.designs import pads_of, parts_of

PLATE = """
scene = "plate.xml"
points = {points}
define = {{ scattering = "lambertian", law = "lambertian", hole = 0 }}
[optimise]
maximise = "rest"
evaluations = 12
[optimise.variables]
z = {{ low = 0.3, high = 1.5, start = 1.2 }}
spacing = {{ low = 0.7, high = 0.9, start = 0.85 }}
"""
CELL = one_cell(scattering="isotropic", fz=0, youngs_modulus=4, led_power=1)
STUDY = """
scene = "cell.xml"
[optimise]
maximise = "sensitivity"
[optimise.variables]
youngs_modulus = [3, 5]
led_power = [0.5, 2]
[optimise.loads]
normal = { fz = [0, -0.2] }
[[optimise.constraints]]
figure = "rest"
most = 0.0055
"""
DIE = """<scene version="3.9.0">
    <default name="y" value="0.1"/>
    <shape type="photo_reflector">
        <string name="part" value="vcnt2020"/> <vector name="led_shift" value="0, $y, 0"/>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"> <rotate x="1" angle="180"/> <scale value="4"/> <translate z="2"/> </transform>
        <bsdf type="wall"> <string name="scattering" value="lambertian"/> </bsdf>
    </shape>
</scene>"""
REFLECTORS = "".join(
    f"""<shape type="photo_reflector">
        <transform name="to_world"> <translate x="{x}"/> </transform>
        <emitter type="annular_led"/> <sensor type="phototransistor"/>
    </shape>"""
    for x in (-1.775, 1.775)
)
PAIR = f"""<scene version="3.9.0">
    <default name="fz" value="-0.1"/> <default name="px" value="0.3"/> <default name="youngs_modulus" value="4"/>
    <shape type="deformable_pad">
        <integer name="rows" value="1"/> <integer name="columns" value="2"/> <float name="mesh_size" value="2.5"/>
        <float name="youngs_modulus" value="$youngs_modulus"/> <string name="load" value="patch_force"/>
        <float name="patch_width" value="1"/> <float name="patch_depth" value="1"/> <float name="patch_x" value="$px"/>
        <vector name="force" value="0, 0, $fz"/>
        <bsdf type="region">
            <bsdf name="roof" type="wall"> <string name="scattering" value="lambertian"/> </bsdf>
        </bsdf>
    </shape>
    {REFLECTORS}
</scene>"""
TOUCHED = """
scene = "pair.xml"
[optimise]
minimise = { figure = "resolution", along = ["z", "place"], of = "place", noise = 1e-6 }
evaluations = 3
[optimise.variables]
youngs_modulus = [3, 5]
[optimise.loads]
z = { px = 0.3, fz = [0, -0.1] }
place = { fz = -0.1, px = [0.25, 0.35] }
"""


def test_a_plate_is_where_quadrature_has_it(tmp_path):
    """The brightest height of a plate, and the least spacing."""
    (tmp_path / "study.toml").write_text(PLATE.format(points=4096).replace("start = 1.2", "start = 1"))
    found = optimise(tmp_path / "study.toml", tmp_path / "out")

    def dark(z):
        return -plate_power(z, law="lambertian", scattering="lambertian", spacing=0.7)

    truth = minimize_scalar(dark, bounds=(0.3, 1.5), method="bounded")
    best = found.variables.set_index("variable").best
    assert best.spacing == 0.7 and best.z == pytest.approx(truth.x, rel=1e-3)
    assert found.figures.best[0] == pytest.approx(-truth.fun, rel=1e-3)
    assert found.figures.best_finer[0] == pytest.approx(-truth.fun, rel=1e-3)
    assert found.probability > 0.999 and list(found.variables["at"]) == ["", "low"]
    assert [note.split(" (")[0] for note in found.notes] == [
        "derivatives with respect to z are differences of readings",
        "derivatives with respect to spacing are differences of readings",
    ]  # fmt: skip


def test_a_die_is_below_the_middle_of_what_it_looks_at(tmp_path):
    """An LED that may lie off the middle of its body along y, where a mirror image is as bright."""
    (tmp_path / "die.xml").write_text(DIE)
    (tmp_path / "study.toml").write_text(
        'scene = "die.xml"\npoints = 1024\n[optimise]\nmaximise = "rest"\n[optimise.variables]\ny = [-0.1, 0.12]\n'
    )
    found = optimise(tmp_path / "study.toml", tmp_path / "out")
    assert found.variables.best[0] == pytest.approx(0, abs=2e-3)


def test_where_a_pad_is_touched_is_told_best_by_a_soft_one(tmp_path):
    """Slopes of small loads are inverse to the modulus. The standard deviation is that of slopes between readings, of
    which the one at rest has a mesh of its own here."""
    (tmp_path / "pair.xml").write_text(PAIR)
    (tmp_path / "study.toml").write_text(TOUCHED)
    found = optimise(tmp_path / "study.toml", tmp_path / "out")
    (figure,) = found.figures.itertuples()
    assert (figure.figure, figure.unit) == ("minimise resolution of place along z, place", "mm")
    assert found.variables["at"][0] == "low" and figure.best == pytest.approx(0.75 * figure.before, rel=5e-3)

    def power(**at):
        return measure(Scene(tmp_path / "pair.xml", {"youngs_modulus": 3, **at}), mechanics_error=False).power

    slopes = np.stack([power(fz=-0.1) - power(fz=0), power(px=0.35) - power(px=0.25)], axis=1) / [-0.1, 0.1]
    expected = 1e-6 * np.sqrt(np.linalg.inv(slopes.T @ slopes)[1, 1])
    assert figure.best == pytest.approx(expected, rel=3e-4)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A cell that was made as sensitive as it can be."""
    folder = tmp_path_factory.mktemp("cell")
    (folder / "cell.xml").write_text(CELL)
    (folder / "study.toml").write_text(STUDY)
    done = run_program(folder, "optimise", "study.toml", "-o", "out", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_a_soft_cell_with_as_much_light_as_is_allowed(cell):
    """Of small loads S = c P / E, and the reading at rest is r P: E at its bound, P where the constraint holds it."""
    _, found = cell
    goal, limit = found["figures"]
    (modulus, power) = found["variables"]
    expected = 0.0055 / limit["before"]
    assert 1.2 < expected < 1.9, "the bound must lie within those of the variables"
    assert modulus["best"] == 3 and modulus["at"] == "low"
    assert power["best"] == pytest.approx(expected, rel=1e-3) and power["at"] == ""
    assert goal["best"] / goal["before"] == pytest.approx(expected * 4 / 3, rel=3e-3)
    assert any("the scene fixes its mesh size, so no finer mesh was tried" in note for note in found["notes"])
    assert limit["multiplier"] == pytest.approx(expected * 4 / 3, rel=5e-3) and found["unbalanced"] < 1e-3
    slopes = {(row["figure"], row["variable"]): row["slope"] for row in found["slopes"]}
    assert slopes[goal["figure"], "led_power"] == pytest.approx(goal["best"] / power["best"], rel=1e-6)
    # S E is a + b / E, and b is known from the ratio: from E = 4 to 3, 1 / E changes by a quarter of its end.
    bend = 4 * (goal["best"] / goal["before"] / (expected * 4 / 3) - 1)
    assert slopes[goal["figure"], "youngs_modulus"] == pytest.approx(-goal["best"] / 3 * (1 + bend), rel=3e-3)


def test_pads_from_files_have_no_drawings():
    scene = Scene("hexagonal.xml")
    assert len(parts_of(scene)) == 1 and not pads_of(scene)


def test_what_is_on_disk(cell):
    folder, found = cell
    made = {file.name for file in (folder / "out").iterdir()}
    tables = {f"{name}.csv" for name in ("figures", "variables", "slopes", "history")}
    drawn = {f"{name}.{form}" for name in ("pad", "mould_base", "mould_frame") for form in ("step", "stl")}
    plots = {f"{name}.{form}" for name in ("optimum", "section") for form in ("png", "svg")}
    assert made == tables | drawn | plots | {"designs", "judged", "best.xml", "optimum.md", "printed.json"}
    study = open_study(folder / "out" / "designs")
    for part, steps in (("designs", found["load_steps"]), ("judged", 4)):
        lines = (folder / "out" / part / "readings.csv").read_text().splitlines()
        assert len([line for line in lines if not line.startswith("#")]) == 1 + steps
        assert (folder / "out" / part / "readings.nc").stat().st_size > 0
    assert study.sizes["step"] == found["load_steps"] == 2 * len(found["history"]) and found["load_steps"] <= 24


def test_nothing_is_computed_twice(cell):
    """The same study with another bound goes on with what there is, to the same end where it asks for the same."""
    folder, found = cell
    before = {file: file.stat().st_mtime_ns for file in folder.rglob("*.npz")}
    verification = optimise(folder / "study.toml", folder / "out")
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*.npz")} == before
    assert verification.history.best.iloc[-1] == found["history"][-1]["best"]


def test_a_cell_no_softer_than_its_strain_allows(cell):
    """Of small loads strains go with 1 / E: the constraint binds where E is what it says."""
    folder, _ = cell
    strain = float(open_study(folder / "out" / "designs").largest_strain[1])  # of E = 4
    limit = f'[[optimise.constraints]]\nfigure = "largest_strain"\nmost = {strain * 4 / 3.5}\n'
    (folder / "firm.toml").write_text(STUDY + limit)
    firm = optimise(folder / "firm.toml", folder / "out")
    assert firm.variables.best[0] == pytest.approx(3.5, rel=3e-3) and firm.figures.multiplier[2] > 0
    assert firm.figures.figure[2].startswith("largest strain along normal <= ")


def test_most_cells_keep_the_constraint(cell):
    """With LEDs that differ by 0.15 W, the light at rest of 90 % of all cells is what is allowed."""
    folder, found = cell
    (folder / "most.toml").write_text(
        STUDY.replace("[optimise.loads]", "[optimise.tolerances]\nled_power = 0.15\n[optimise.loads]")
    )
    robust = optimise(folder / "most.toml", folder / "out")
    expected = 0.0055 / found["figures"][1]["before"] - 1.2816 * 0.15
    assert robust.variables.best[1] == pytest.approx(expected, rel=1e-3) and robust.variables.best[0] == 3
    assert robust.figures.best[1] == pytest.approx(0.0055, rel=1e-3) and "90 % of all sensors" in robust.notes[0]
    (goal, _) = found["figures"]
    share = (expected - 1.2816 * 0.15) * 4 / 3
    assert robust.figures.best[0] == pytest.approx(share * goal["before"], rel=3e-3)


def test_a_run_that_was_ended_goes_on(tmp_path):
    study = PLATE.format(points=64).replace("evaluations = 12", "evaluations = 4")
    (tmp_path / "study.toml").write_text(re.sub("spacing = .*", "", study))

    def ended(progress):
        if progress.designs == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise(tmp_path / "study.toml", tmp_path / "out", progress=ended)
    kept = {file: file.stat().st_size for file in (tmp_path / "out").rglob("jobs/*.npz")}
    assert len(kept) >= 2 and list((tmp_path / "out").rglob("readings.csv"))
    reports = []
    went_on = optimise(tmp_path / "study.toml", tmp_path / "out", progress=reports.append)
    whole = optimise(tmp_path / "study.toml", tmp_path / "whole")
    assert went_on.best == whole.best and went_on.history.equals(whole.history)
    assert [progress.designs for progress in reports][-1] == len(whole.history) and "maximise rest" in reports[-1].best


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("first_contact", "first contact along z cannot be computed: it does not change the load of a pad."),
        (
            "range",
            "range along up cannot be computed without a table [circuit]: first contact along z cannot be computed: it "
            "does not change the load of a pad.",
        ),
    ],
)
def test_how_far_what_is_no_pad_may_be_loaded(tmp_path, goal, said):
    study = (
        PLATE.format(points=64).replace('"rest"', f'"{goal}"').replace("z = { low = 0.3, high = 1.5, start = 1.2 }", "")
    )
    (tmp_path / "study.toml").write_text(f"{study}[optimise.loads]\nup = {{ z = [1.5, 1.2] }}\n")
    with pytest.raises(InputError) as refused:
        optimise(tmp_path / "study.toml", tmp_path / "out")
    assert str(refused.value) == said


def test_a_taxel_that_the_scene_does_not_have(tmp_path):
    study = PLATE.format(points=64).replace("z = { low = 0.3, high = 1.5, start = 1.2 }", "")
    constraint = '[[optimise.constraints]]\nfigure = "cross_talk"\ntaxel = 9\nmost = 1.0\n'
    (tmp_path / "study.toml").write_text(f"{study}[optimise.loads]\nup = {{ z = [1.5, 1.2] }}\n{constraint}")
    with pytest.raises(InputError) as refused:
        optimise(tmp_path / "study.toml", tmp_path / "out")
    assert str(refused.value) == (
        "cross talk along up cannot be computed: taxel = 9 of this figure in the study file is not allowed: the taxels "
        "of the scene have the numbers 1 to 1."
    )


@pytest.mark.parametrize(
    ("constraints", "said"),
    [
        ((("rest", "least", 0.03), ("largest_reading", "most", 0.02), ("rest", "least", 0.001)), "in conflict"),
        ((("rest", "least", 1.0),), "beyond reach"),
        ((("least_wall", "least", 1.0),), "least wall cannot be computed for this scene"),
        ((("rest", "least", 0.016),), "constraints met by no design yet, but more evaluations or starts may find one"),
    ],
)
def test_constraints_that_cannot_hold(tmp_path, constraints, said):
    text = "".join(
        f'[[optimise.constraints]]\nfigure = "{name}"\n{way} = {bound}\n' for name, way, bound in constraints
    )
    count = 1 if "yet" in said else 4
    study = PLATE.format(points=64).replace("evaluations = 12", f"evaluations = {count}")
    (tmp_path / "study.toml").write_text(study + text)
    with pytest.raises(InputError) as refused:
        optimise(tmp_path / "study.toml", tmp_path / "out")
    assert said in str(refused.value) and "\n" not in str(refused.value)
    if said == "in conflict":
        assert "rest >= 0.03" in str(refused.value) and "<= 0.02" in str(refused.value)
        assert ">= 0.001" not in str(refused.value)


PROFILE = """
scene = "cell.xml"
[optimise]
maximise = "rest"
evaluations = 6
[optimise.variables]
r1 = { low = 0.7, high = 1.0, start = 0.9 }
r2 = { low = 0.5, high = 1.0, start = 0.7 }
z2 = { low = 0.4, high = 1.0, start = 0.8 }
[[optimise.constraints]]
figure = "draft_angle"
least = 10
[[optimise.constraints]]
figure = "least_radius"
least = 0.6
"""


def test_the_profile_of_a_cell_within_what_its_mould_allows(tmp_path):
    """The brightest roof is held by both constraints; its pad is drawn before and after."""
    cell = one_cell(cell="profile", scattering="isotropic", r1=0.9, r2=0.7, z2=0.8)
    points = '<string name="profile" value="$r1 0.6; $r2 $z2; 0 1"/> <vector'
    (tmp_path / "cell.xml").write_text(cell.replace("<vector", points, 1))
    (tmp_path / "study.toml").write_text(PROFILE)
    found = optimise(tmp_path / "study.toml", tmp_path / "out")
    goal, draft, radius, view = found.figures.itertuples()
    assert goal.best > 1.2 * goal.before
    assert draft.best == pytest.approx(10, rel=1e-3) and radius.best == pytest.approx(0.6, rel=1e-3)
    assert draft.multiplier > 0 and radius.multiplier > 0
    assert view.figure == "view angle >= 2" and view.best > 20 and view.multiplier == 0
    assert list(found.variables["at"]) == ["low", "", ""]
    assert found.unbalanced < 0.05


SHAPES = """
scene = "cell.xml"
[optimise]
minimise = "rest"
evaluations = 2
[optimise.variables]
h = [1.45, 1.6]
r2 = { low = 0.3, high = 0.6, only = { shape = "profile" } }
[optimise.choices]
shape = ["cylindrical", "profile"]
[[optimise.constraints]]
figure = "least_radius"
least = 0.5
"""


def test_shapes_of_which_one_has_a_profile(tmp_path):
    """Each is what it is by itself; constraints of profiles leave cylinders alone."""
    text = one_cell(cell="$shape", scattering="isotropic", shape="profile", r2=0.5, h=1.5)
    parts = '<string name="profile" value="1 0.8; $r2 0.8; 0 1"/> <float name="cell_height" value="$h"/> <vector'
    (tmp_path / "cell.xml").write_text(text.replace("<vector", parts, 1))
    (tmp_path / "study.toml").write_text(SHAPES)
    found = optimise(tmp_path / "study.toml", tmp_path / "out")
    rows = found.history.set_index("shape")
    assert rows.loc["cylindrical"].r2.isna().all() and rows.loc["profile"].r2.notna().all()
    for shape, profile in (("cylindrical", None), ("profile", "1 0.8; 0.5 0.8; 0 1")):
        pad = Pad(shape, rows=1, columns=1, cell_height=1.5, profile=profile)
        alone = measure(Scene(PadSensor(pad, roof=Wall(scattering="isotropic")).scene().source, mesh_size=2.5))
        assert rows.loc[shape].rest.iloc[0] == pytest.approx(alone.power[0], rel=1e-6)
    radius = found.figures.set_index("figure").loc["least radius >= 0.5"]
    assert radius.before > 0.5 and np.isnan(radius.best)
    assert found.before == {"shape": "profile", "h": "1.5", "r2": "0.5"} and found.best["shape"] == "cylindrical"
    assert found.best["r2"] == "none" and found.variables.best.isna().tolist() == [False, True]
    assert "nan" not in (tmp_path / "out" / "optimum.md").read_text()
    assert set(found.slopes.variable) == {"h"} and list(found.variables["at"]) == ["high", ""]


def test_the_best_design_behind_a_circuit_is_not_saturated(tmp_path):
    """Noise as a force falls with the LED's power, up to where the converter of 0.3 V ends, less 1 %: the light is
    proportional to that power, and 100 Ohm make 0.3 V of 3 mW. The first design is beyond."""
    (tmp_path / "cell.xml").write_text(CELL)
    study = STUDY.split("[[")[0].replace('maximise = "sensitivity"', 'minimise = "noise_equivalent_force"')
    study = study.replace("led_power = [0.5, 2]", "led_power = { low = 0.3, high = 2, start = 1 }")
    circuit = "[circuit]\nsupply = 3.3\nload_resistance = 100\ntransfer = 1\nadc_reference = 0.3\nother_noise = 4e-4\n"
    (tmp_path / "study.toml").write_text(study + circuit)
    found = optimise(tmp_path / "study.toml", tmp_path / "out")
    limit = found.figures.set_index("figure").loc["saturation along normal <= 0.99"]
    assert limit.before > 1 and limit.best == pytest.approx(0.99, abs=2e-3)
    assert float(found.best["youngs_modulus"]) == pytest.approx(3) and limit.multiplier > 0
    assert any(one.startswith("the first design saturates") for one in found.warnings)


def test_a_circuit_that_saturates_in_all_designs_has_too_much_gain(tmp_path):
    """The constraint is not one of the study: to relax it is no remedy."""
    study = PLATE.format(points=64).replace('"rest"', '"sensitivity"').replace("evaluations = 12", "evaluations = 2")
    study = study.replace("z = { low = 0.3, high = 1.5, start = 1.2 }", "")
    circuit = "[circuit]\nsupply = 3.3\nload_resistance = 1e9\ntransfer = 1\n"
    (tmp_path / "study.toml").write_text(f"{study}[optimise.loads]\nup = {{ z = [1.5, 1.2] }}\n{circuit}")
    with pytest.raises(InputError, match="saturation along up.* Lower the gain of the table .circuit. ") as refused:
        optimise(tmp_path / "study.toml", tmp_path / "out")
    assert "Relax" not in str(refused.value)
