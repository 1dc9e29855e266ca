"""What a parameter is follows from where it is used, not from its name."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr
from edited_pad import TWO_CELLS, edited
from taxel_cli.readings.sweep import _show

from mitsuba_taxel.characterise import experiments, sensitivity, sensitivity_table
from mitsuba_taxel.characterise.roles import force_parameters, forces_by_parameter, with_forces_named
from mitsuba_taxel.characterise.summary import slope_summary
from mitsuba_taxel.plots.curves import plot_curves
from mitsuba_taxel.plots.maps import plane_of
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.sensing.scene.finding import shipped_scenes
from mitsuba_taxel.sensing.scene.parameter_roles import forces_of_parameters, roles_of_parameters
from mitsuba_taxel.studies import sweep, training_set
from mitsuba_taxel.studies.plan.batch import make_batch
from mitsuba_taxel.studies.plan.vary import curve_dimension
from tests.helpers.renamed_scenes import differences

CELL = """<scene version="3.9.0">
    <default name="{name}" value="{value}"/> <default name="modulus" value="4"/>
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="youngs_modulus" value="$modulus"/> <float name="mesh_size" value="3"/>
        <vector name="force" value="0, 0, {use}"/>
        <bsdf type="region"><bsdf name="roof" type="wall"><string name="scattering" value="lambertian"/></bsdf></bsdf>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"> <string name="law" value="lambertian"/> </emitter>
        <sensor type="phototransistor"/> </shape>
</scene>"""


@pytest.mark.parametrize("file", sorted(path.name for path in shipped_scenes().glob("*.xml")))
def test_every_default_of_the_shipped_scenes_may_have_another_name(tmp_path, file):
    """Names are drawn at random; those of the components of the force are dealt to other parameters, too.

    In a scene without a pad such a name alone says that a parameter is a force.
    """
    text, random = find_scene(file).read_text(), np.random.default_rng(5)
    own = forces_of_parameters(find_scene(file))
    names = re.findall(r'<default name="(\w+)"', text)
    dealt = random.permutation(["fx", "fy", "fz"]) if own.keys() & set(names) else []
    new = [*dealt, *(f"name_{number}" for number in random.permutation(100))]
    renamed = dict(zip(names, new, strict=False))
    for name, other in renamed.items():
        text = re.sub(rf'(<default name="|\$){name}\b', rf"\1_{other}_", text)
    (tmp_path / file).write_text(re.sub(r"_(\w+?)_(?=\W)", r"\1", text))
    found = forces_of_parameters(tmp_path / file)
    assert {name: role for name, role in found.items() if name in renamed.values()} == {
        renamed[name]: role for name, role in own.items() if name in renamed
    }


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """The same study with three names of its force."""
    folder = tmp_path_factory.mktemp("renamed")
    made = {}
    for name, use, sign in (("fz", "$fz", 1), ("f", "$f", 1), ("press", "-$press", -1)):
        file = folder / f"{name}.xml"
        file.write_text(CELL.format(name=name, value=-1 * sign, use=use))
        values = [0.0, -1.0 * sign, -2.0 * sign]
        made[name] = sweep(file, {name: values}, points=64, derivatives=[name], output=folder / name)
    return made


@pytest.mark.parametrize("name", ["f", "press"])
def test_slopes_are_those_of_the_force_under_its_own_name(studies, name):
    expected, found = sensitivity_table(studies["fz"]), sensitivity_table(studies[name])
    assert list(found.force) == ["fz"] and list(found.columns) == list(expected.columns)
    for column in expected.select_dtypes("number"):
        np.testing.assert_allclose(found[column], expected[column], rtol=1e-12)
    (_, summary), (_, renamed) = slope_summary(studies["fz"]), slope_summary(studies[name])
    for column in summary.select_dtypes("number"):
        np.testing.assert_allclose(renamed[column], summary[column], rtol=1e-12)
    one, other = sensitivity(studies["fz"], "fz"), sensitivity(studies[name], name)
    xr.testing.assert_allclose(one, other, rtol=1e-12)
    (first,), (second,) = experiments(studies["fz"]), experiments(studies[name])
    np.testing.assert_allclose(second.runs[0].force, first.runs[0].force)
    np.testing.assert_allclose(second.runs[0].tangents.slope, first.runs[0].tangents.slope, rtol=1e-9)


def test_the_parameter_that_must_be_varied_is_called_as_in_the_scene(studies):
    assert force_parameters(studies["press"]) == ["press"] and force_parameters(studies["fz"]) == ["fz"]
    assert force_parameters(xr.DataTree(studies["f"])) == ["f"] and force_parameters(xr.Dataset()) == ["fx", "fy", "fz"]


@pytest.mark.parametrize(("name", "shown"), [("fz", "fz"), ("f", "fz = f"), ("press", "fz = -press")])
def test_the_line_of_a_slope_names_the_parameter_of_the_scene(studies, name, shown, capsys, tmp_path):
    """With its sign: the slope is that over the force."""
    _show("", studies[name], tmp_path)
    assert capsys.readouterr().out.startswith(f"Mean slope over {shown}: ")
    assert forces_by_parameter(xr.DataTree.from_dict({"a": studies[name], "b": studies[name]})) == (
        {} if name == "fz" else {"fz": shown.removeprefix("fz = ")}
    )


def test_what_is_named_is_left_and_names_that_are_taken_too(studies):
    assert json.loads(studies["press"].attrs["forces"])["press"] == ["fz", -1]
    plain = with_forces_named(studies["press"])
    assert plain.fz.values.tolist() == [0, -1, -2] and with_forces_named(plain).identical(plain)
    taken = with_forces_named(studies["f"].assign_coords(fz=("f", [7.0, 8.0, 9.0])))
    assert taken.fz.values.tolist() == [0, -1, -2] and taken["parameter fz"].values.tolist() == [7, 8, 9]


def test_a_range_without_a_step_is_allowed_for_every_force(tmp_path):
    from mitsuba_taxel.studies.plan.batch import make_batch

    (tmp_path / "scene.xml").write_text(CELL.format(name="f", value=-1, use="$f"))
    (axis,) = make_batch(tmp_path / "scene.xml", {"f": "0:-2"}).axes
    assert axis.is_open and axis.is_force
    batch = make_batch(tmp_path / "scene.xml", {"f": [0, -1]}, target_slope=0.1)
    assert batch.varied_forces == ("f",) and batch.derivatives == ("f",)


@pytest.mark.parametrize("file", ["pad.xml", "plate.xml"])
def test_a_shipped_scene_says_the_same_under_other_names(tmp_path, file):
    """Tables, slopes, plots, exports, on large elements; of the pad of nine cells, two, of which each is as the others.

    ``tests/helpers/renamed_scenes.py`` compares the scenes as they are, and for other seeds.
    """
    (tmp_path / "shipped").mkdir()
    scene = edited(tmp_path / "shipped", file, *TWO_CELLS) if file == "pad.xml" else find_scene(file)
    assert differences(scene, 3, tmp_path, mesh_size=2.2) == []


TOUCH = """<scene version="3.9.0">
    <default name="a" value="0"/> <default name="fz" value="0"/> <default name="c" value="0"/>
    <default name="t" value="0"/> <default name="before" value=""/> <default name="time" value="4"/>
    <shape type="deformable_pad">
        <string name="load" value="indenter_displacement"/> <string name="indenter" value="sphere"/>
        <float name="indenter_radius" value="3"/> <float name="indenter_x" value="$a"/>
        <float name="indenter_y" value="-$fz"/> <vector name="displacement" value="0.1, 0, -$c"/>
        <string name="prony" value="0.2 1"/> <string name="history" value="$before"/>
        <float name="time" value="$t"/> <float name="youngs_modulus" value="$time"/>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
</scene>"""


def test_displacements_places_and_times_are_found_where_they_are_used(tmp_path):
    file = tmp_path / "touch.xml"
    file.write_text(TOUCH)
    assert roles_of_parameters(file) == {
        "a": ("indenter_x", 1),
        "fz": ("indenter_y", -1),
        "c": ("uz", -1),
        "t": ("time", 1),
        "before": ("history", 1),
        "time": ("youngs_modulus", 1),
    }
    assert "fz" not in forces_of_parameters(file)
    batch = make_batch(file, {"a": [0, 1], "fz": [0, 1], "c": "0:1"})
    assert batch.axes[2].is_open and curve_dimension(batch.axes) == "c"
    path = make_batch(file, {"a": [0, 1]}, together={"t": [1, 2], "c": [0.5, 0.25]}).axes[1]
    assert path.values["before"] == ["0 0 0 0", "0 0 0 0; 1 0.1 0 -0.5"]


def test_a_pressure_and_a_vector_in_one_parameter(tmp_path):
    file = tmp_path / "pressed.xml"
    file.write_text(
        '<scene version="3.9.0"> <default name="f" value="0 0 -1"/> <default name="p" value="0"/>'
        '<shape type="deformable_pad"> <vector name="force" value="$f"/> <float name="pressure" value="-$p"/> </shape>'
        "</scene>"
    )
    assert roles_of_parameters(file) == {"f": ("force", 1), "p": ("pressure", -1)}
    assert "f" not in forces_of_parameters(file)


def test_training_sets_have_forces_of_every_name(studies):
    """Beside a parameter that is only called as a force."""
    many = {
        name: studies[name].isel({name: np.arange(12) % 3}).assign_coords({name: sign * np.arange(12.0)})
        for name, sign in (("fz", -1), ("press", 1))
    }
    many["press"].attrs |= {"parameters": '{"fx": "7", "modulus": "4"}', "forces": '{"press": ["fz", -1]}'}
    expected, found = training_set(many["fz"]), training_set(many["press"])
    for part in expected:
        assert found[part].columns.tolist() == expected[part].columns.tolist()
        np.testing.assert_allclose(found[part], expected[part], rtol=1e-12)


def touched(**coords):
    """A study of steps at places, of which taxel 2 changes most at the first place and taxel 1 at others."""
    count = len(coords["a"])
    power = np.ones((count, 2, 2))
    first = np.asarray(coords["a"]) == coords["a"][0]
    power[:, :, 1] += np.where(first, coords["c"], 0)[:, None]
    power[:, :, 0] += np.where(first, 0, coords["c"])[:, None]
    roles = {"a": ["indenter_x", 1], "b": ["indenter_y", 1], "c": ["uz", -1]}
    return xr.Dataset(
        {
            "replicate_power": (["step", "replicate", "taxel"], power),
            "total_error": (["step", "taxel"], np.full((count, 2), 0.01)),
            "power": (["step", "taxel"], power.mean(axis=1)),
        },
        coords={**{name: ("step", values) for name, values in coords.items()}, "taxel": [1, 2], "step": range(count)},
        attrs={"curve": "step", "scene": "scene.xml", "roles": json.dumps(roles), "forces": "{}"},
    )


def test_places_are_curves_over_the_load_with_the_taxel_that_changes_most():
    figure = plot_curves(touched(a=[2.0, 1, 2, 1], b=[0.0, 1, 0, 1], c=[0.0, 0, 0.5, 0.25]))
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["a = 1, b = 1, taxel 1", "a = 2, b = 0, taxel 2"]
    assert [line.lines[0].get_xdata().tolist() for line in figure.axes[0].containers] == [[0, 0.25], [0, 0.5]]
    assert figure.get_supxlabel() == "c"


def test_places_that_are_pressed_once_are_not_joined_and_make_a_map():
    from mitsuba_taxel.plots.maps import has_map, plot_map

    once = touched(a=[2.0, 1, 2], b=[0.0, 1, 1], c=[0.5, 0.25, 0.5])
    lines = [container.lines[0] for container in plot_curves(once).axes[0].containers]
    assert [line.get_linestyle() for line in lines] == ["None"] * 2
    assert has_map(once) and plane_of(once) is None
    dots = plot_map(once).axes[0].collections[0]
    np.testing.assert_allclose(dots.get_offsets(), [[2, 0], [1, 1], [2, 1]])


def test_places_are_sorted():
    from mitsuba_taxel.plots.curves import curves_of

    steps = touched(a=[2.0, 1, 3], b=[0.0, 0, 0], c=[0.5, 0.25, 0.5])
    along = steps.drop_vars(["a", "b", "c", "step"]).rename(step="x").assign_coords(x=[2.0, 1, 3])
    (curve,) = curves_of(along.assign_attrs(curve="x", roles="{}"))
    assert curve.x.tolist() == [1, 2, 3]
    np.testing.assert_allclose(curve.samples[:, 0], along.replicate_power.values[[1, 0, 2], 0])
