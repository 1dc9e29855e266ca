"""The contact model of a pad: against full solutions of balls and rods, balance of forces, and what it flags."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from mitsuba_taxel import InputError, PadSensor, measure
from mitsuba_taxel.mechanics import (
    DeadForce,
    Indenter,
    IndenterDisplacement,
    Mullins,
    NeoHookean,
    SpreadForce,
    Viscoelastic,
    load_path,
    reactions,
)
from mitsuba_taxel.mechanics.derivatives.top_compliance import top_grid
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.derivatives.wall_gradient import WallGradient
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.specification.wall import Wall
from mitsuba_taxel.surrogates import ContactModel, FrictionPads, contact_model, export_contact
from mitsuba_taxel.surrogates.contact_readings import NOT_A_NUMBER, NOT_RESOLVED, NOT_SOLVED, TOO_DEEP, TOO_FAR
from mitsuba_taxel.surrogates.contact_states import Touch, solved_touch

PAD, SILICONE, SPACING, SIZE = Pad("parallelepiped", rows=1, columns=1), NeoHookean(0.3, 0.49), 0.455, 0.7
SENSOR = PadSensor(pad=PAD, material=SILICONE)


@pytest.fixture(scope="module")
def model():
    return contact_model(SENSOR.scene(), 0.25, spacing=SPACING, mesh_size=SIZE)


def depths(model, kind, radius, place, depth):
    """Map of the depth of a ball or a rod along x."""
    x, y = model.points[..., 0] - place[0], model.points[..., 1] - place[1]
    distance = np.hypot(x, y) if kind == "sphere" else np.abs(y)
    below = depth - radius + np.sqrt(np.maximum(radius**2 - distance**2, 0.0))
    return np.where(distance < radius, below, -1.0)


@pytest.mark.parametrize(
    ("kind", "radius", "place", "depth"),
    [("sphere", 4.0, (0.7, 0.5), 0.12), ("sphere", 2.0, (0.0, 0.0), 0.2), ("cylinder", 1.2, (0.0, 0.0), 0.15)],
)
def test_balls_and_rods_at_small_depths_are_as_in_the_full_solution(model, kind, radius, place, depth):
    touch = IndenterDisplacement(Indenter(kind, radius=radius, at=place))
    state = load_path(PAD, SILICONE, [(0, 0, -depth)], load=touch, mesh_size=1.5)[0]
    full = reactions(state)
    readings = model(depths(model, kind, radius, place, depth))
    assert readings.inside.all()
    assert readings.force[0, 2] == pytest.approx(full.applied_force[2], rel=0.06)
    assert readings.moment[0, :2] == pytest.approx(full.applied_moment[:2], abs=0.06 * abs(full.applied_force[2]))
    assert readings.centre[0] == pytest.approx(place if kind == "sphere" else (0, place[1]), abs=0.05)
    change = WallGradient(DiffuseCells(SENSOR.scene().load()), state).power - model.rest
    assert change == pytest.approx((readings.power - model.rest)[0], rel=0.08)  # linear: the rest is of second order


@dataclass(frozen=True)
class OnPatches(DeadForce):
    """A force in given proportions on the nodes."""

    loads_rim = False
    has_position = False
    areas: tuple = field(default=(), kw_only=True)

    def nodal(self, mesh):
        return np.array(self.areas)

    def loaded_area(self, mesh):
        return 1.0


def test_the_forces_hold_the_pad_at_the_depth_of_the_body_and_balance_the_board(model):
    """Two balls at once, small and beside each other; the forces are put on the pad in a full solution."""
    shallow = [1e-3 * depths(model, "sphere", 4.0, place, 0.2) for place in ((-1.0, 0.2), (0.9, -0.5))]
    readings = model(np.maximum(*shallow))
    rest = load_path(PAD, SILICONE, [(0, 0, 0)], load=SpreadForce(), mesh_size=SIZE)[0]
    _, weights = top_grid(rest.mesh, SPACING)
    forces = readings.pressure[0].ravel() * np.prod(model.size)
    load = OnPatches(areas=tuple((forces @ weights).tolist()))
    state = load_path(PAD, SILICONE, [(0, 0, -forces.sum())], load=load, mesh_size=SIZE, step_tolerance=1e-6)[0]
    balance = reactions(state)
    assert balance.force == pytest.approx([0, 0, forces.sum()], abs=1e-6 * forces.sum())
    assert readings.force[0, 2] == pytest.approx(-forces.sum(), rel=1e-12)
    assert balance.moment[:2] == pytest.approx(-readings.moment[0, :2], abs=2e-3 * forces.sum())
    down, touching = -(weights @ state.displacement[:, 2]), forces > 0
    means = model._means(np.maximum(*shallow)[None])[0].ravel()
    np.testing.assert_allclose(down[touching], means[touching], rtol=2e-3)
    assert (down[~touching] > means[~touching]).all()
    top = model.displacement(np.maximum(*shallow))[0].reshape(-1, 3)
    moved = weights @ state.displacement
    np.testing.assert_allclose(top, moved, rtol=0, atol=2e-3 * np.abs(moved).max())
    assert np.abs(moved[:, :2]).max() > 0.05 * np.abs(moved).max()
    assert readings.area == pytest.approx(np.count_nonzero(touching) * np.prod(model.size))


def test_forces_and_readings_are_linear_while_the_contact_stays(model):
    flat = np.where(np.hypot(*model.points[..., :2].transpose(2, 0, 1)) < 1.2, 0.1, -1.0)
    tilted = np.where(flat > 0, 0.1 + 0.005 * model.points[..., 0], -1.0)
    once, other, both = (model(maps) for maps in (flat, tilted, flat + tilted))
    assert (np.count_nonzero(once.pressure) == np.count_nonzero(both.pressure)) and once.pressure.any()
    np.testing.assert_allclose(both.pressure, once.pressure + other.pressure, rtol=0, atol=1e-9 * both.pressure.max())
    np.testing.assert_allclose(both.power + model.rest, once.power + other.power, rtol=1e-12)
    assert not model(flat - 1).force.any() and np.isnan(model(flat - 1).centre).all()
    np.testing.assert_array_equal(model(flat - 1).power[0], model.rest)


def test_what_is_beyond_the_model_is_flagged_for_each_pad(model, monkeypatch):
    good = depths(model, "sphere", 3.0, (0.2, 0.1), 0.2)
    maps = np.stack([good] * 6)
    maps[1, 2, 3] = np.nan
    maps[2] += 0.2
    maps[3] = depths(model, "sphere", 3.0, (2.2, 0.0), 0.2)
    maps[4] = depths(model, "sphere", 0.3, (0.2, 0.1), 0.2)
    maps[5, 0, 0] = -np.inf
    readings = model(maps)
    assert readings.status.tolist() == [0, NOT_A_NUMBER, TOO_DEEP, TOO_FAR, NOT_RESOLVED, NOT_A_NUMBER]
    for values in (readings.power, readings.force[:, 2], readings.moment[:, 0], readings.centre, readings.area):
        rows = values.reshape(6, -1)
        assert np.isnan(rows[[1, 5]]).all() and np.isfinite(rows[[0, 2, 3, 4]]).all()
    np.testing.assert_array_equal(model(good).power[0], readings.power[0])
    unsolved = "mitsuba_taxel.surrogates.contact_readings.contact_forces"
    monkeypatch.setattr(unsolved, lambda compliance, depth: np.full(depth.shape, np.nan))
    assert model(good).status.tolist() == [NOT_SOLVED]
    for other in (good[1:], good[None, None], "map", good.ravel()):
        with pytest.raises(InputError, match=r"depth of shape .* of 10 rows and 10 columns"):
            model(other)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force": (0, 0, -0.1)}, "the pad at rest: set the load"),
        ({"material": Viscoelastic(SILICONE, ((0.3, 1.0),))}, "remove prony"),
        ({"material": Mullins(SILICONE, 2.0, 0.01)}, "remove mullins"),
        ({"load": IndenterDisplacement(Indenter(radius=2.0, friction=0.5))}, "remove indenter_friction"),
        ({"roof": Wall("mirror")}, "random paths|diffuse|mirror|reflect"),
    ],
)
def test_scenes_without_such_a_model_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        contact_model(replace(SENSOR, **changes).scene(), 0.1, spacing=1.0)


@pytest.mark.parametrize("name", ["depth", "spacing", "mesh_size"])
@pytest.mark.parametrize("value", [0, -1.0, np.nan, "deep", True])
def test_lengths_that_are_none_are_refused(name, value):
    with pytest.raises(InputError, match=f"{name} = .* a finite length in mm above 0"):
        contact_model(SENSOR.scene(), **{"depth": 0.1, name: value})


def test_gradients_are_differences_of_readings_of_the_batch(model):
    """Readings change along a depth as gradient, compliance and contact say."""
    maps = depths(model, "sphere", 3.0, (0.2, 0.1), 0.2)
    step = 1e-6
    change = (model(maps + step).power - model(maps - step).power)[0] / (2 * step)
    touching = model(maps).pressure[0].ravel() > 0
    inverse = np.linalg.inv(model.compliance[np.ix_(touching, touching)])
    assert change == pytest.approx((model.gradient[:, touching] @ inverse).sum(axis=1), rel=1e-6)
    assert isinstance(model, ContactModel)


def test_full_solutions_are_those_of_a_scene_with_the_body():
    """The same depth in a scene of its own: readings as `measure` gives them, and the reaction of the pad."""
    silicone = NeoHookean(0.5, 0.49)
    sensor = PadSensor(pad=PAD, material=silicone)
    touch = Touch("sphere", 3.0, 0.0, 0.0, 0.0, 0.3)
    solved = solved_touch(DiffuseCells(sensor.scene().load()), touch)
    pressed = replace(sensor, force=(0, 0, -0.3), load=IndenterDisplacement(touch.indenter()))
    readings = measure(pressed.scene(), mechanics_error=False)
    assert solved.power[1] == pytest.approx(readings.power, rel=3e-3)
    assert solved.force[1][2] < solved.force[0][2] < 0
    state = load_path(PAD, silicone, [(0, 0, -0.3)], load=IndenterDisplacement(touch.indenter()))[0]
    reaction = reactions(state).applied_force
    assert solved.force[1] == pytest.approx(reaction, abs=1e-6 * abs(reaction[2]))


def test_friction_of_models_is_a_flag_and_kept_by_npz_alone(tmp_path):
    for words in ({"friction": 0.6}, {"friction": "no"}):
        with pytest.raises(InputError, match="friction = .* True or False"):
            contact_model(SENSOR.scene(), 0.1, **words)
        with pytest.raises(InputError, match="friction = .* True or False"):
            export_contact(SENSOR.scene(), tmp_path / "pad.npz", 0.1, **words)
    with pytest.raises(InputError, match=r"friction = True .* models in \.py have no friction: a \.npz file is needed"):
        export_contact(SENSOR.scene(), tmp_path / "pad.py", 0.1, friction=True)


@pytest.mark.parametrize("friction", [False, True])
def test_progress_counts_all_forces(friction):
    steps = []
    model = contact_model(SENSOR.scene(), 0.1, spacing=2.0, friction=friction, progress=lambda *at: steps.append(at))
    forces = np.count_nonzero(model.covered) * (3 if friction else 1)
    assert steps == [(done, forces) for done in range(1, forces + 1)]


@pytest.fixture(scope="module")
def with_friction():
    return contact_model(SENSOR.scene(), 0.25, spacing=SPACING, mesh_size=SIZE, friction=True)


@pytest.mark.parametrize(
    ("radius", "place", "depth", "friction", "slides"),
    [
        (2.0, (0.0, 0.0), 0.2, 0.4, [(0.03, 0.0), (0.15, 0.0), (0.05, 0.0)]),
        (5.0, (0.3, -0.2), 0.2, 0.25, [(0.0, 0.1), (-0.2, 0.15)]),
    ],
)
def test_a_ball_that_slides_is_as_in_the_full_solution(with_friction, radius, place, depth, friction, slides):
    """The bounds are those of few patches, four to fourteen of which are in contact, and of large strains."""
    model, pads, last = with_friction, FrictionPads(with_friction, 1, friction), np.zeros(2)
    cells = DiffuseCells(SENSOR.scene().load())
    load = IndenterDisplacement(Indenter(radius=radius, at=place, friction=friction))
    values = [(*slide, -depth) for slide in [(0.0, 0.0), *slides]]
    for value, state in zip(values, load_path(PAD, SILICONE, values, load=load, mesh_size=1.5), strict=True):
        now = np.array(value[:2])
        across = model.points[..., :2] - place - now
        squares = (across**2).sum(axis=-1)
        maps = depth - radius + np.sqrt(np.maximum(radius**2 - squares, 0.0))
        found = pads.step(np.where(squares < radius**2, maps, -1.0)[None], (now - last)[None]).readings
        last, full = now, reactions(state)
        scale = friction * abs(full.applied_force[2])
        assert found.force[0, 2] == pytest.approx(full.applied_force[2], rel=0.05)
        np.testing.assert_allclose(found.force[0, :2], full.applied_force[:2], rtol=0, atol=0.08 * scale)
        np.testing.assert_allclose(found.moment[0], full.applied_moment, rtol=0, atol=0.08 * scale * PAD.height)
        change = WallGradient(cells, state).power - model.rest
        np.testing.assert_allclose(found.power[0] - model.rest, change, rtol=0.08)  # the rest is of second order
