"""The load at which a pad first touches something: its derivatives against a closed form and against differences."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.sensing.derivatives.first_contact import first_contact

pytestmark = pytest.mark.usefixtures("llvm_mono")
NUMBERS = {"cell_size": 2.55, "cell_height": 1.75, "youngs_modulus": 4.0, "z": 0.02, "fx": 0.0, "fz": -1.0}
STEPS = {"cell_height": 0.002, "z": 0.002}


@pytest.fixture(scope="module")
def contact(tmp_path_factory):
    """First contact of one cell in a low and wide pad, whose package lies above the board."""
    file = tmp_path_factory.mktemp("contact") / "cell.xml"
    given = "".join(f'<float name="{name}" value="${name}"/> ' for name in ("cell_size", "cell_height"))
    low = '<float name="height" value="3"/> <float name="wall" value="2"/> '
    text = one_cell(mesh_size=3, **NUMBERS).replace("<vector", given + low + "<vector", 1)
    place = '<shape type="photo_reflector"> <transform name="to_world"><translate z="$z"/></transform>'
    file.write_text(text.replace('<shape type="photo_reflector">', place))

    def found(along="fz", last=-1.0, furthest=-100.0, names=(), cell_height=1.75, **changed):
        origin = {"meshed_as": f"cell_size={NUMBERS['cell_size']}, cell_height={cell_height}"}
        values = NUMBERS | {"cell_height": cell_height} | changed

        def at(value):
            given = {name: repr(float(number)) for name, number in {**values, along: value}.items()}
            return Scene(file, given | origin)

        return first_contact(at, along, last, furthest, names)

    return found


def test_loads_are_proportional_to_the_modulus(contact):
    """As of all neo-Hookean pads, whose other dimensions are the same: here one that touches itself."""
    found = contact(names=("youngs_modulus",))
    assert found.value < -10 and found.touched == "itself"
    assert found.rates == pytest.approx([found.value / NUMBERS["youngs_modulus"]], rel=1e-3)


def test_derivatives_are_differences_of_the_whole_chain(contact):
    """A roof that meets the package, on one mesh; along a change of both, in which each has a third of the effect at
    least."""
    found, base = contact(names=tuple(STEPS), cell_height=0.7), {**NUMBERS, "cell_height": 0.7}
    assert found.value < -10 and found.touched == "a package"
    ends = (contact(**{name: base[name] + sign * step for name, step in STEPS.items()}).value for sign in (1, -1))
    parts = found.rates * list(STEPS.values())
    assert parts.sum() == pytest.approx(np.subtract(*ends) / 2, rel=3e-3)
    assert np.all(np.abs(parts) > abs(parts.sum()) / 3)


def test_a_load_beyond_which_nothing_is_asked(contact):
    found = contact(furthest=-2.0, names=("youngs_modulus",))
    assert (found.value, found.rates.tolist(), found.touched) == (-2.0, [0.0], "")


STEPS_OF_HIGH = {"height": 0.01, "cell_size": 0.01}
HIGH = {"youngs_modulus": 4.0, "height": 4.55, "cell_size": 2.55, "led_power": 1.0, "fz": -1.0}


@pytest.fixture(scope="module")
def unstable(tmp_path_factory):
    """Where the path of a single high cell ends, which becomes unstable before it touches anything."""
    file = tmp_path_factory.mktemp("high") / "high.xml"
    given = "".join(f'<float name="{name}" value="${name}"/> ' for name in ("height", "cell_size"))
    file.write_text(one_cell(**HIGH).replace("<vector", given + "<vector", 1))
    origin = {"meshed_as": f"height={HIGH['height']}, cell_size={HIGH['cell_size']}"}

    def found(names=(), **changed):
        def at(fz):
            values = {**HIGH, **changed, "fz": fz}
            return Scene(file, {name: repr(float(value)) for name, value in values.items()} | origin)

        return first_contact(at, "fz", -1.0, -40.0, names)

    return found


def test_a_path_that_ends_before(unstable):
    """To scale with the modulus, and otherwise as differences of the whole chain have it, on one mesh."""
    found = unstable(tuple(HIGH)[:-1])
    assert -40 < found.value < -1 and found.touched == "" and "is unstable" in found.ended
    by = dict(zip(HIGH, found.rates, strict=False))
    assert by.pop("youngs_modulus") == pytest.approx(found.value / HIGH["youngs_modulus"], rel=1e-5)
    assert by.pop("led_power") == 0
    parts = np.array([rate * STEPS_OF_HIGH[name] for name, rate in by.items()])
    ends = (unstable(**{name: HIGH[name] + way * STEPS_OF_HIGH[name] for name in by}).value for way in (1, -1))
    assert parts.sum() == pytest.approx(np.subtract(*ends) / 2, rel=2e-3)
    assert np.all(np.abs(parts) > abs(parts.sum()) / 3)


@pytest.mark.parametrize(
    ("along", "last", "furthest", "said"),
    [
        ("youngs_modulus", 4.0, 40.0, "along youngs_modulus cannot be computed: it does not change the load"),
        ("fz", -1.0, -100.0, "along fz cannot be computed: its values do not lie on one load path"),
    ],
)
def test_what_is_no_line_of_a_path_is_refused(contact, along, last, furthest, said):
    """Such as pressing harder beside a force to the side."""
    with pytest.raises(InputError) as refused:
        contact(along, last, furthest, fx=0.01)
    assert said in str(refused.value)


def test_a_dragged_indenter_is_refused(tmp_path):
    """At each place it has a path of its own."""
    load = """<string name="load" value="indenter_displacement"/> <float name="indenter_radius" value="4"/>
        <vector name="displacement" value="$dx, 0, -0.1"/>"""
    start, force = one_cell(fz=-1).replace('"fz"', '"dx"').split("<vector", 1)
    text = start + load + force.split("/>", 1)[1]
    (tmp_path / "dragged.xml").write_text(text)
    with pytest.raises(InputError, match="along dx cannot be computed: a dragged indenter has a separate path"):
        first_contact(lambda dx: Scene(tmp_path / "dragged.xml", {"dx": dx}), "dx", 0.5, 1.0)


def test_a_force_on_an_indenter_is_refused(tmp_path):
    """Its paths are those of the displacement."""
    text = one_cell(fz=-1).replace(
        "<vector", '<string name="load" value="indenter_force"/> <float name="indenter_radius" value="4"/> <vector', 1
    )
    (tmp_path / "pressed.xml").write_text(text)
    with pytest.raises(InputError, match="along fz cannot be computed: paths of an indenter follow its displacement"):
        first_contact(lambda fz: Scene(tmp_path / "pressed.xml", {"fz": fz}), "fz", -1.0, -10.0)
