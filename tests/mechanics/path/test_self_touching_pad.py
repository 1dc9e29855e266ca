"""Paths of pads that go on where they touch themselves and the board."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
import trimesh

from mitsuba_taxel import PadSensor, Scene, measure
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import NeoHookean, PlateDisplacement, SpreadForce, Viscoelastic, linearise, load_path
from mitsuba_taxel.mechanics import reactions as reactions_of
from mitsuba_taxel.mechanics.contact.barrier import Barrier
from mitsuba_taxel.mechanics.contact.self_contact import ContactTest
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.path.self_touching_pad import SelfTouchingPad
from mitsuba_taxel.pads import REGIONS, Pad
from mitsuba_taxel.specification.deformable_pad import DeformablePad

pytest.importorskip("ipctk")
pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

PAD, LAW, ON = Pad("parallelepiped", rows=1, columns=1), NeoHookean(), PlateDisplacement(self_contact=True)
BEFORE, BEYOND = (0, 0, -0.9), (0, 0, -1.3)
"""Displacements beside that of -1.25 mm at which the pad touches the board."""


def pressed(*values, load=ON, material=LAW, **more):
    return load_path(PAD, material, values, load=load, mesh_size=2.0, **more)


@pytest.fixture(scope="module")
def touching():
    return pressed(BEYOND)[0]


def test_a_path_goes_on_where_the_pad_touches_itself_and_the_board(touching):
    with pytest.raises(
        ComputationError, match=r"touches the board.* -0\.99\d*\) mm\. With self_contact = true it goes on"
    ):
        pressed(BEYOND, load=PlateDisplacement())
    barrier = Barrier(touching.mesh, LAW.youngs_modulus)
    own, board = barrier.forces(touching.displacement)
    assert np.abs(own).sum() > 0.5 and board[:, 2].sum() > 0.5
    assert 0 < barrier.gap(touching.displacement) < barrier.reach
    lifted = touching.displacement + (0, 0, barrier.reach)  # more than curved faces sink between their corners
    found = ContactTest(touching.mesh).find(lifted)  # by other means; the board first
    assert found is None or found.what == "itself"  # in a crease, whose adjacent faces do not repel each other
    assert touching.stability_checked and touching.min_jacobian > 0
    np.testing.assert_allclose(own.sum(axis=0), 0, atol=1e-9)
    reactions = reactions_of(touching)
    assert reactions.imbalance < 1e-8
    assert reactions.force[2] > board[:, 2].sum()


def test_nothing_changes_before_it_touches():
    (with_it,), (without) = pressed(BEFORE), pressed(BEFORE, load=PlateDisplacement())
    np.testing.assert_allclose(with_it.displacement, without[0].displacement, atol=1e-5)


def test_forces_have_a_potential(touching):
    """Their derivative is symmetric, and that by which the pad is solved; there are none at rest."""
    barrier, rng = Barrier(touching.mesh, LAW.youngs_modulus), np.random.default_rng(1)
    assert not any(np.any(forces) for forces in barrier.forces(np.zeros_like(touching.displacement)))
    stiffness = barrier.stiffness(touching.displacement)
    assert abs(stiffness - stiffness.T).max() < 1e-9 * abs(stiffness).max()
    way, step = rng.standard_normal(touching.displacement.shape), 1e-8
    ahead, behind = (sum(barrier.forces(touching.displacement + sign * step * way)) for sign in (1, -1))
    expected = (stiffness @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose((behind - ahead) / (2 * step), expected, atol=1e-4 * np.abs(expected).max())


def test_work_of_the_plate_is_stored_in_the_pad_or_done_against_contact(touching):
    mesh, step = touching.mesh, 5e-4
    elements = Assembly(mesh, LAW, number_unknowns(mesh, np.zeros(len(mesh.points), bool))).elements

    def energy(state):
        here = slice(None)
        gradient = elements.gradient(here, state.displacement) + np.eye(3)
        pressure = elements.pressures(here, state.pressure)
        return (elements.weight * (LAW.energy(gradient) + LAW.compressibility / 2 * pressure**2)).sum()

    less, more = pressed((0, 0, BEYOND[2] + step), (0, 0, BEYOND[2] - step))
    contact = sum(Barrier(mesh, LAW.youngs_modulus).forces(touching.displacement))
    done = (contact * touching.path_rate().displacement).sum()
    assert done < -0.01
    assert (energy(more) - energy(less)) / (2 * step) == pytest.approx(reactions_of(touching).force[2] + done, rel=2e-5)


def test_readings_are_continuous_through_the_first_touch():
    depths, read, error = 1.246 + np.array([-0.04, -0.02, 0.0, 0.02, 0.04]), [], []
    for depth in depths:
        source = dict(PadSensor(pad=PAD, force=(0, 0, -depth), load=ON).scene().source)
        source["pad"] = {**source["pad"], "mesh_size": 2.0}
        readings = measure(Scene(source), target_error=2e-3, mechanics_error=False)
        read.append(float(readings.power[0]))
        error.append(float(readings.standard_error[0]))
    curve = np.polynomial.Polynomial.fit(depths, read, 2)
    assert np.abs(read - curve(depths)).max() < 4 * max(error) + 1e-3 * read[2]  # false alarm below 3e-4
    assert read[0] > 1.1 * read[2] > 1.2 * read[4]


def test_a_package_ends_a_path_that_goes_on():
    """Where the roof comes down on it, and no state of the path changes by it."""
    package = trimesh.creation.box((1.0, 1.4, 0.8))
    package.apply_translation([0, 0, 0.401])
    with pytest.raises(ComputationError, match="touches a package near .* mm, which is outside the model") as ended:
        pressed(BEYOND, obstacles=package.triangles)
    assert "self_contact" not in str(ended.value)  # it is on
    end = float(re.search(r"displacement = \(0, 0, (-[\d.]+)\) mm", str(ended.value))[1])
    (held,), (last,) = pressed((0, 0, 0.99 * end), obstacles=package.triangles), pressed((0, 0, end))
    np.testing.assert_array_equal(held.displacement, pressed(tuple(held.value))[0].displacement)
    roof = np.unique(last.mesh.faces[last.mesh.face_region == REGIONS["roof"]])
    lowest = (last.mesh.points + last.displacement)[roof, 2].min()
    assert lowest == pytest.approx(0.801, abs=2e-3)


def test_states_are_the_same_bits_in_any_order(fresh, touching):
    fresh()
    before, again = pressed(BEFORE, BEYOND)
    np.testing.assert_array_equal(again.displacement, touching.displacement)
    fresh()
    np.testing.assert_array_equal(pressed(BEFORE)[0].displacement, before.displacement)


def test_a_symmetric_part_touches_as_the_whole_does(touching):
    whole = SelfTouchingPad(touching.mesh, LAW, ON)
    unknowns = whole.gather(touching.displacement, touching.pressure)
    found = whole.balance(unknowns + 1e-6 * np.random.default_rng(0).standard_normal(len(unknowns)), touching.value)
    np.testing.assert_allclose(whole.split(found)[0], touching.displacement, atol=1e-7)


def test_what_does_not_go_with_it(touching, monkeypatch):
    with pytest.raises(InputError, match="derivatives with self_contact are not available"):
        linearise(touching)
    with pytest.raises(InputError, match="self_contact of a viscoelastic silicone is not available"):
        pressed(BEFORE, material=Viscoelastic(LAW, ((0.2, 1.0),)), times=[1.0])
    with pytest.raises(InputError, match="self_contact is not allowed for load = 'indenter_displacement'"):
        DeformablePad(load="indenter_displacement", indenter="plane", self_contact=True)
    with pytest.raises(InputError, match="self_contact = 1 is not allowed: True or False is needed"):
        SpreadForce(self_contact=1)
    monkeypatch.setitem(sys.modules, "ipctk", None)
    with pytest.raises(InputError, match="self_contact needs the package ipctk: pip install ipctk"):
        Barrier(touching.mesh, 1.0)


def test_a_scene_goes_on_too():
    load, value = DeformablePad(load="plate_displacement", displacement=BEYOND, self_contact=True).build_load()
    assert (load, value) == (ON, BEYOND)
    written = DeformablePad.of(PAD, LAW, ON, BEYOND, None)
    assert written.self_contact is True and written.build_load()[0] == ON
    assert DeformablePad.of(PAD, LAW, PlateDisplacement(), BEYOND, None).self_contact is False
