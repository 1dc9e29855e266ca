"""Paths of pads that go on where they touch themselves and the board."""

from __future__ import annotations

import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from touching_pads import (
    ASIDE,
    BEFORE,
    BEYOND,
    CLEAR,
    HELD,
    LAW,
    ON,
    PACKAGE,
    PAD,
    SIZE,
    SMALL,
    TOP,
    lowest,
    pressed,
    stored,
)

from mitsuba_taxel import PadSensor, PhotoReflector, Scene, measure
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.mirror import ACROSS_X
from mitsuba_taxel.kernels.surfaces.mesh_adapter import places_of
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    NeoHookean,
    PlateDisplacement,
    PlateForce,
    SpreadForce,
    Viscoelastic,
    linearise,
    load_path,
)
from mitsuba_taxel.mechanics import reactions as reactions_of
from mitsuba_taxel.mechanics.contact.barriers.barrier import Barrier
from mitsuba_taxel.mechanics.contact.barriers.body_barrier import BodyBarrier
from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.mechanics.equilibrium.feet import couple_held, near_feet
from mitsuba_taxel.mechanics.equilibrium.self_touching_pad import SelfTouchingPad
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.sensing.audit import energy_audit
from mitsuba_taxel.specification.deformable_pad import DeformablePad

pytest.importorskip("ipctk")
pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


@pytest.fixture(scope="module")
def touching():
    return pressed(BEYOND)[0]


@pytest.fixture(scope="module")
def leaning():
    """Pressed onto the board, and aside."""
    return pressed((0.3, 0, -25.0), load=PlateForce(self_contact=True), size=SMALL)[0]


def test_a_path_goes_on_where_the_pad_touches_itself_and_the_board(touching):
    with pytest.raises(
        ComputationError, match=r"touches itself.* -1\.10\d*\) mm\. With self_contact = true the path continues"
    ):
        pressed(BEYOND, load=PlateDisplacement())
    with pytest.raises(
        ComputationError, match=r"touches the board.* -0\.99\d*\) mm\. With self_contact = true the path continues"
    ):
        pressed((0, 0, -1.3), load=PlateDisplacement(), size=SMALL)
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


def test_little_changes_before_it_touches():
    """Its feet alone, whose law is linear: roofs come down as much within 1e-3, at 20 % of the height."""
    (with_it,), (without,) = pressed(BEFORE), pressed(BEFORE, load=PlateDisplacement())
    roof = np.unique(without.mesh.faces[without.mesh.face_region == REGIONS["roof"]])
    change = np.abs(with_it.displacement - without.displacement)[roof].max()
    assert 0 < change < 1e-3 * np.abs(without.displacement[roof]).max()


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


@pytest.mark.parametrize("name", ["touching", "held"])
def test_work_of_the_plate_is_stored_in_the_pad_or_done_against_contact(name, request):
    touching, step = request.getfixturevalue(name), 5e-4
    mesh, packages = touching.mesh, {"obstacles": PACKAGE} if name == "held" else {}
    depth = touching.value[2]
    less, more = pressed((0, 0, depth + step), (0, 0, depth - step), **packages)
    contact = sum(Contacts(mesh, LAW.youngs_modulus, touching.bodies).forces(touching.displacement))
    done = (contact * touching.path_rate().displacement).sum()
    assert done < -1e-3
    assert (stored(more) - stored(less)) / (2 * step) == pytest.approx(reactions_of(touching).force[2] + done, rel=2e-5)


def scene(depth, package, size=SIZE):
    reflector = PhotoReflector(body=(1.46, 1.06, package))
    source = dict(PadSensor(pad=PAD, photo_reflector=reflector, force=(0, 0, -depth), load=ON).scene().source)
    source["pad"] = {**source["pad"], "mesh_size": size}
    return Scene(source)


def test_readings_are_continuous_through_the_first_touch():
    depths, read, error = 1.246 + np.array([-0.04, -0.02, 0.0, 0.02, 0.04]), [], []
    for depth in depths:
        readings = measure(scene(depth, 0.5, SMALL), points=1 << 11, mechanics_error=False)
        read.append(float(readings.power[0]))
        error.append(float(readings.standard_error[0]))
    curve = np.polynomial.Polynomial.fit(depths, read, 2)
    assert max(error) < 2e-3 * read[2]
    assert np.abs(read - curve(depths)).max() < 4 * max(error) + 1e-3 * read[2]  # false alarm below 3e-4
    assert read[0] > 1.1 * read[2] > 1.2 * read[4]


def test_readings_fall_and_stay_low_as_the_roof_comes_down_on_the_package():
    """It covers the LED within a few hundredths of a millimetre, and is held from 0.47 mm on."""
    depths = 0.47 + 2e-3 * np.arange(-2, 3)
    readings = [measure(scene(depth, TOP), points=1 << 12, mechanics_error=False) for depth in depths]
    read, error = np.array([(r.power[0], r.standard_error[0]) for r in readings]).T
    assert (np.diff(read) < 4 * np.hypot(error[1:], error[:-1])).all()  # false alarm below 2e-4
    assert read[0] > 5 * read[4] and error.max() < 0.05 * np.ptp(read)


def test_no_light_passes_where_the_roof_rests_on_the_package():
    """It ends on what touches: none on the outside of the pad, where it would be if the roof were below the LED."""
    live = scene(0.6, TOP).load()
    audit = energy_audit(live, points=1 << 10)
    share = dict(zip(audit.places, audit.share, strict=True))
    assert share["pad top"] == share["pad outer"] == 0 and share["pad in contact"] > 0.5
    assert audit.total == pytest.approx(1, abs=1e-9)
    pad = next(shape for shape in live.shapes() if hasattr(shape, "surface"))
    over = np.all(np.abs(pad.surface.facing[:, :2]) < (0.73, 0.53), axis=1)
    assert pad.surface.facing[over, 2].min() > TOP
    np.testing.assert_allclose(places_of(pad).vertices, pad.surface.facing, atol=1e-6)
    before = pad.state
    measure(live, points=256, mechanics_error=False)
    np.testing.assert_array_equal(pad.state.displacement, before.displacement)


@pytest.fixture(scope="module")
def held():
    return pressed(HELD, obstacles=PACKAGE)[0]


def test_a_package_ends_a_path_that_does_not_go_on():
    """Where the roof comes down on it, and no state of the path changes by it."""
    without = PlateDisplacement()
    with pytest.raises(ComputationError, match=r"touches a package near .* With self_contact = true") as end:
        pressed(HELD, load=without, obstacles=PACKAGE)
    last = float(re.search(r"displacement = \(0, 0, (-[\d.]+)\) mm", str(end.value))[1])
    (free,) = pressed((0, 0, last), load=without)
    assert lowest(free) == pytest.approx(TOP, abs=2e-3)


def test_a_roof_rests_on_a_package(held):
    """Faces, curved between the points that are kept off it, neither touch nor enter it, by other means."""
    barrier = BodyBarrier(held.mesh, LAW.youngs_modulus, held.bodies)
    pushed = barrier.forces(held.displacement)
    assert 0 < barrier.gap(held.displacement) < barrier.reach
    assert ContactTest(held.mesh, PACKAGE).find_package(held.displacement) is None
    assert TOP < lowest(held) < TOP + barrier.reach
    assert pushed[:, 2].sum() > 0.5 and np.abs(pushed[:, :2].sum(axis=0)).max() < 1e-9  # it pushes back, upwards
    assert reactions_of(held).imbalance < 1e-8 and held.stability_checked
    (free,) = pressed(HELD)
    assert lowest(free) < TOP - 0.05
    assert reactions_of(held).force[2] > reactions_of(free).force[2] + 0.1  # silicone that goes around it resists


def test_a_package_that_is_not_touched_changes_nothing():
    (with_it,), (without,) = pressed(CLEAR, obstacles=PACKAGE), pressed(CLEAR)
    np.testing.assert_allclose(with_it.displacement, without.displacement, atol=1e-9)
    with pytest.raises(InputError, match="the undeformed pad touches a package near .* move one of them"):
        pressed(CLEAR, obstacles=PACKAGE + (0, 0, 1.0))


def test_a_package_off_the_middle_is_touched_by_the_pad_without_symmetry(held):
    """And one an eighth of a micrometre off it nearly as in the middle, where a quarter of the pad is solved."""
    (beside,) = pressed(HELD, obstacles=PACKAGE + (1.25e-4, 0, 0))
    assert not beside.bodies.kept_by(ACROSS_X) and held.bodies.kept_by(ACROSS_X)
    np.testing.assert_allclose(beside.displacement, held.displacement, atol=3e-4)
    assert reactions_of(beside).force[2] == pytest.approx(reactions_of(held).force[2], rel=1e-4)


def test_moments_balance_of_a_pad_that_leans():
    """Though the linear law of its feet resists rotations."""
    (state,) = pressed(ASIDE)
    assert reactions_of(state).imbalance < 1e-9
    linear = near_feet(state.mesh)
    couple = couple_held(state.mesh, LAW, linear, state.displacement, state.pressure)
    assert abs(couple[1]) > 1e-6 * np.linalg.norm(reactions_of(state).moment)


def test_states_are_the_same_bits_in_any_order(fresh, touching):
    fresh()
    before, again = pressed(BEFORE, BEYOND)
    np.testing.assert_array_equal(again.displacement, touching.displacement)
    fresh()
    np.testing.assert_array_equal(pressed(BEFORE)[0].displacement, before.displacement)


def test_states_on_a_package_are_the_same_bits_again(fresh, held):
    fresh()
    (again,) = pressed(HELD, obstacles=PACKAGE)
    np.testing.assert_array_equal(again.displacement, held.displacement)
    np.testing.assert_array_equal(again.pressure, held.pressure)


def test_a_pad_of_one_cell_tips_over_under_the_same_force_on_finer_elements():
    """A real instability, of a path that goes on, too: the top, free to turn, leans to either side."""
    ends = []
    for size, self_contact in ((2.5, True), (2.5, False), (1.6, False)):
        with pytest.raises(ComputationError, match="the equilibrium is unstable") as end:
            load_path(PAD, LAW, [(0, 0, -40)], load=SpreadForce(self_contact=self_contact), mesh_size=size)
        ends.append(float(re.search(r"force = \(0, 0, (-[\d.]+)\) N", str(end.value))[1]))
    assert ends[:2] == pytest.approx([ends[2]] * 2, rel=0.05)


def test_a_symmetric_part_touches_as_the_whole_does():
    """Before corners that press on each other slide off to one side."""
    (touching,) = pressed((0, 0, -1.55))
    assert all(np.any(forces) for forces in Barrier(touching.mesh, LAW.youngs_modulus).forces(touching.displacement))
    whole = SelfTouchingPad(touching.mesh, LAW, ON)
    unknowns = whole.gather(touching.displacement, touching.pressure)
    found = whole.equilibrium(unknowns + 1e-6 * np.random.default_rng(0).standard_normal(len(unknowns)), touching.value)
    np.testing.assert_allclose(whole.split(found)[0], touching.displacement, atol=1e-7)


def test_what_does_not_go_with_it(touching, monkeypatch):
    with pytest.raises(InputError, match="self_contact = 1 is not allowed: True or False is needed"):
        SpreadForce(self_contact=1)
    monkeypatch.setitem(sys.modules, "ipctk", None)
    with pytest.raises(InputError, match="self_contact needs the package ipctk: pip install ipctk"):
        Barrier(touching.mesh, 1.0)


@pytest.mark.parametrize("name", ["held", "leaning"])
def test_derivatives_are_those_of_differences(name, request):
    """By value, material and shape at once, where board or package push, and feet have a linear law."""
    state = request.getfixturevalue(name)
    touched = Contacts(state.mesh, LAW.youngs_modulus, state.bodies).all_forces(state.displacement)
    assert np.abs(touched).sum() > 0.5
    answer, rng = linearise(state), np.random.default_rng(5)
    velocity = state.mesh.points * (0.1, -0.1, 0.05) + state.mesh.points[:, 2:] * rng.uniform(-0.1, 0.1, (1, 3))
    direction = np.array([1.0, 0.5, 0.3])

    def moved(step):
        mesh = replace(state.mesh, points=state.mesh.points + step * velocity)
        law = LAW.changed(poisson_ratio=LAW.poisson_ratio + step)
        pad = SelfTouchingPad(mesh, law, state.load, bodies=state.bodies)
        value, start = state.value + step * direction, pad.gather(answer.displacement, answer.pressure)
        return pad.split(pad.solve_with_tangent(pad.equilibrium(start, value), value)[0].unknowns)[0]

    by_material, by_shape = answer.by_material("poisson_ratio"), answer.by_shape(velocity)
    found, expected = answer.by_value(direction) + by_material + by_shape, (moved(1e-6) - moved(-1e-6)) / 2e-6
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())
    gradient = rng.standard_normal(velocity.shape)
    back = answer.pull_back(gradient, {"shape": velocity})
    assert back.material["poisson_ratio"] == pytest.approx(np.vdot(gradient, by_material), rel=1e-9)
    assert back.shape["shape"] == pytest.approx(np.vdot(gradient, by_shape), rel=1e-9)


def test_under_a_force_moduli_and_forces_scale(leaning):
    """Of twice the modulus under twice the force, the pad is displaced as before."""
    answer = linearise(leaning)
    by_force, by_modulus = answer.by_value(leaning.value), answer.by_material("youngs_modulus")
    np.testing.assert_allclose(-LAW.youngs_modulus * by_modulus, by_force, atol=1e-8 * np.abs(by_force).max())


BALL, DEEP = Indenter("sphere", radius=2.5), (0, 0, -2.4)
"""Displacement beside that of -2.2 mm at which walls touch under the ball."""


SOFT, LEFT = Viscoelastic(LAW, ((0.2, 1.0), (0.3, 10.0))), 0.5 * LAW.shear_modulus
"""A silicone with a memory, and the shear modulus in MPa that lasts; its compressibility is that of the law."""
_MODULUS = 9 * LEFT / (3 + LEFT * LAW.compressibility)
LASTING = NeoHookean(_MODULUS, _MODULUS / (2 * LEFT) - 1)
LATE = 1e7
"""A time in s at which nothing else is left."""


def in_the_long_run(state):
    """The elastic pad of the lasting law near a state, which the same barriers keep apart."""
    pad = SelfTouchingPad(state.mesh, LASTING, state.load, bodies=state.bodies)
    pad.contacts = Contacts(state.mesh, LAW.youngs_modulus, state.bodies)
    return pad.split(pad.equilibrium(pad.gather(state.displacement, state.pressure), state.value))


@pytest.mark.parametrize(("value", "bodies"), [(BEYOND, {}), (HELD, {"obstacles": PACKAGE})])
def test_what_touches_relaxes_from_the_instantaneous_to_the_lasting_law(value, bodies):
    at_once, late = pressed(value, value, material=SOFT, times=[0.0, LATE], **bodies)
    (elastic,) = pressed(value, **bodies)
    np.testing.assert_allclose(at_once.displacement, elastic.displacement, atol=1e-8)
    np.testing.assert_allclose(late.displacement, in_the_long_run(late)[0], atol=1e-7)
    forces = [reactions_of(state) for state in (at_once, late)]
    assert forces[1].force[2] == pytest.approx(0.5 * forces[0].force[2], rel=0.06)  # it does not fill gaps as before
    assert max(reactions.imbalance for reactions in forces) < 1e-8
    assert at_once.stability_checked and late.stability_checked


def test_a_pad_creeps_onto_the_board():
    """Which it does not touch at first, under a force on a plate; under half a newton more it ends unstable.

    A corner slides off an edge on the way, past which out-of-balance forces grow.
    """
    load = PlateForce(self_contact=True)
    first, late = pressed(*[(0, 0, -14.5)] * 2, load=load, material=SOFT, times=[0.0, LATE], size=SMALL)
    pushed = [Barrier(s.mesh, LAW.youngs_modulus).forces(s.displacement)[1][:, 2].sum() for s in (first, late)]
    assert pushed[0] == 0 and pushed[1] > 0.3
    np.testing.assert_allclose(late.displacement, in_the_long_run(late)[0], atol=1e-6)
    assert max(reactions_of(state).imbalance for state in (first, late)) < 1e-8


def test_moments_balance_of_a_leaning_pad_with_a_memory():
    (state,) = pressed(ASIDE, material=SOFT, times=[2.0])
    assert reactions_of(state).imbalance < 1e-8


def test_an_incompressible_pad_goes_on_too():
    law = NeoHookean(LAW.youngs_modulus, 0.5)
    (with_it,), (without,) = (pressed(CLEAR, material=law, load=load) for load in (ON, PlateDisplacement()))
    roof = np.unique(without.mesh.faces[without.mesh.face_region == REGIONS["roof"]])
    change = np.abs(with_it.displacement - without.displacement)[roof].max()
    assert 0 < change < 1e-3 * np.abs(without.displacement[roof]).max()


def test_a_scene_goes_on_too():
    names = {"indenter": "sphere", "indenter_radius": 2.5, "indenter_x": 1.0, "friction": 0.3, "self_contact": True}
    indented, _ = DeformablePad(load="indenter_displacement", displacement=DEEP, **names).build_load()
    assert indented == IndenterDisplacement(replace(BALL, at=(1.0, 0.0), friction=0.3), self_contact=True)
    assert DeformablePad.of(PAD, LAW, indented, DEEP, None).build_load()[0] == indented
    load, value = DeformablePad(load="plate_displacement", displacement=BEYOND, self_contact=True).build_load()
    assert (load, value) == (ON, BEYOND)
    written = DeformablePad.of(PAD, LAW, ON, BEYOND, None)
    assert written.self_contact is True and written.build_load()[0] == ON
    assert DeformablePad.of(PAD, LAW, PlateDisplacement(), BEYOND, None).self_contact is False
