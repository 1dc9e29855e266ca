"""What a parameter is follows from where it is used, not from its name."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.characterise import experiments, sensitivity, sensitivity_table
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.sensing.parameter_roles import forces_of_parameters
from mitsuba_taxel.sensing.scene import shipped_scenes
from mitsuba_taxel.studies import sweep

CELL = """<scene version="3.9.0">
    <default name="{name}" value="{value}"/> <default name="modulus" value="4"/>
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="youngs_modulus" value="$modulus"/> <float name="mesh_size" value="1.6"/>
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
    one, other = sensitivity(studies["fz"], "fz"), sensitivity(studies[name], name)
    xr.testing.assert_allclose(one, other, rtol=1e-12)
    (first,), (second,) = experiments(studies["fz"]), experiments(studies[name])
    np.testing.assert_allclose(second.runs[0].force, first.runs[0].force)
    np.testing.assert_allclose(second.runs[0].tangents.slope, first.runs[0].tangents.slope, rtol=1e-9)


def test_what_is_named_is_left_and_names_that_are_taken_too(studies):
    assert json.loads(studies["press"].attrs["forces"])["press"] == ["fz", -1]
    plain = with_forces_named(studies["press"])
    assert plain.fz.values.tolist() == [0, -1, -2] and with_forces_named(plain).identical(plain)
    taken = studies["f"].assign_coords(fz=("f", [7.0, 8.0, 9.0]))
    assert "f" in with_forces_named(taken).dims


def test_a_range_without_a_step_is_allowed_for_every_force(tmp_path):
    from mitsuba_taxel.studies.plan.batch import make_batch

    (tmp_path / "scene.xml").write_text(CELL.format(name="f", value=-1, use="$f"))
    (axis,) = make_batch(tmp_path / "scene.xml", {"f": "0:-2"}).axes
    assert axis.is_open and axis.is_force
    batch = make_batch(tmp_path / "scene.xml", {"f": [0, -1]}, target_slope=0.1)
    assert batch.varied_forces == ("f",) and batch.derivatives == ("f",)
