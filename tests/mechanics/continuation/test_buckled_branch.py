"""Columns that buckle, against the elastica, and what a load path makes of them."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import trimesh
from scipy.optimize import brentq
from scipy.special import ellipk

from mitsuba_taxel import PadSensor, PhotoReflector, measure
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import ACROSS_X, ACROSS_Y
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    NeoHookean,
    PlateDisplacement,
    SpreadForce,
    Viscoelastic,
    linearise,
    load_path,
)
from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.continuation import pad_path, path_problem
from mitsuba_taxel.mechanics.continuation.buckled_branch import BuckledBranch
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.onset_of_buckling import find_onset
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad
from mitsuba_taxel.mechanics.errors import second_meshes
from mitsuba_taxel.mechanics.errors.second_meshes import SecondMeshes
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.scene.scene_pads import loaded_pads

LENGTH, WIDTH, MODULUS = 16.0, 2.0, 4.0
EULER = MODULUS * np.pi**2 / 48 * WIDTH / LENGTH**2
"""Of a column of unit thickness that is clamped below and free above."""
LEAN = 0.5
"""How far one may lean between bodies beside it, in mm."""


def bent(load):
    """Deflection of the end of an elastica under a load relative to Euler's, relative to its length."""
    modulus = brentq(lambda m: (2 * ellipk(m) / np.pi) ** 2 - load, 1e-9, 0.5)
    return 2 * np.sqrt(modulus) / ellipk(modulus)


def branch_of(pad, direction, kept):
    """Onset and branch of a column, loaded until it buckles."""
    segment = LoadSegment(np.zeros(3), np.array(direction), 4 * EULER, judged=True)
    segment.extend(pad, 2 * EULER, partial(np.zeros, pad.unknowns), pad.contact, lambda: False)
    onset = find_onset(pad, segment)
    segment.end_buckling(pad, pad.contact, *onset)
    part = loaded_pad(pad.whole, pad.material, pad.load, kept)
    return onset, BuckledBranch(part, segment, pad.split(onset.node.unknowns))


@pytest.fixture(params=["rslab", "superlu"])
def judging(request, monkeypatch):
    """Each of the solvers alone."""
    monkeypatch.setattr("mitsuba_taxel.mechanics.elements.solvers.available_solvers", lambda: [request.param])
    loaded_pad.cache_clear()
    yield
    loaded_pad.cache_clear()


def test_an_elastica(symmetric_block, judging):
    """Slender enough for shear and shortening to change a deflection by less than 1 %."""
    mesh = symmetric_block((1.0, WIDTH, LENGTH), (1, 1, 8))
    pad = loaded_pad(mesh, NeoHookean(MODULUS, 0.0), SpreadForce(), (ACROSS_X, ACROSS_Y))
    onset, branch = branch_of(pad, (0.0, 0.0, -1.0), (ACROSS_Y,))
    assert onset.node.s == pytest.approx(EULER, rel=0.005)
    branch.extend(1.05 * onset.node.s, pad.contact, lambda: False)
    assert len(branch.curve.nodes) > 5 and branch.limit == np.inf
    top = mesh.points[:, 2] == LENGTH
    for load in (1.001, 1.01, 1.03, 1.05):
        displacement = branch.pad.split(branch.at(branch.pad, load * onset.node.s).unknowns)[0]
        assert displacement[top, 0].mean() / LENGTH == pytest.approx(bent(load), rel=0.01)


@pytest.fixture
def columns(fresh, monkeypatch, symmetric_block):
    """Pads that are columns in truth; a function that forgets all states in memory."""
    monkeypatch.setattr(
        path_problem, "pad_mesh", lambda pad, size: symmetric_block((1.0, WIDTH, LENGTH), (1, 1, round(8 / size)))
    )
    return fresh


def test_a_load_path_goes_on_beyond(columns):
    """On the branch it is in balance; its rate is that of its tangent; it does not depend on what else is asked for."""
    pad, law, value = Pad(), NeoHookean(MODULUS, 0.0), np.array((0, 0, -1.05 * EULER))
    straight, state = load_path(pad, law, [0.9 * value, value], mesh_size=1.0)
    assert straight.buckled_at is None and state.buckled_at == pytest.approx((0, 0, -EULER), rel=0.005)
    top = state.mesh.points[:, 2] == LENGTH
    lean = bent(value[2] / state.buckled_at[2]) * LENGTH
    assert np.abs(straight.displacement[top, 0]).max() < 1e-3 * lean
    assert state.displacement[top, 0].mean() == pytest.approx(lean, rel=0.01)
    at_state, rate = linearise(state), state.path_rate()
    np.testing.assert_allclose(at_state.displacement, state.displacement, atol=1e-3 * lean)
    along = at_state.by_value(rate.direction)
    np.testing.assert_allclose(rate.displacement, along, atol=0.01 * np.abs(along).max())
    columns()
    (again,) = load_path(pad, law, [value], mesh_size=1.0)
    np.testing.assert_array_equal(again.displacement, state.displacement)
    columns()
    (cold,) = load_path(pad, law, [value], mesh_size=1.0, step_tolerance=1.1e-5)  # of another place in the cache
    np.testing.assert_allclose(cold.displacement, state.displacement, atol=1e-3 * lean)


def test_the_same_branch_on_other_elements_and_sideways(columns, monkeypatch):
    """Its error is told by that; under sideways forces, symmetries that it has lost are not used."""
    law, value, compared = NeoHookean(MODULUS, 0.0), np.array((0, 0, -1.05 * EULER)), []

    def remember(second, *state):
        compared.append(second)
        raise LookupError

    monkeypatch.setattr(second_meshes, "carried_to", remember)
    (state,) = load_path(Pad(), law, [value], mesh_size=1.0)
    path = pad_path.pad_path(Pad(), law, SpreadForce(), 1.0)
    monkeypatch.setattr(SecondMeshes, "first", lambda self, told: told(path.on_elements(0.67), None))
    with pytest.raises(LookupError):
        _ = state.error
    (other,) = compared
    found = other.state(value)
    there = found.displacement[found.mesh.points[:, 2] == LENGTH, 0].mean()
    here = state.displacement[state.mesh.points[:, 2] == LENGTH, 0].mean()
    assert here > 0 and there == pytest.approx(here, rel=0.05)
    assert "self_contact" in str(path._end(0.9 * value, "touches itself", np.zeros(3), []))
    end = str(path._end(value, "touches itself", np.zeros(3), []))
    assert "It buckled at" in end and "self_contact" in end
    assert path.segments.pad_for(0.9 * value, np.array([1.0, 0, 0])).mirrors == (ACROSS_Y,)
    assert path.segments.pad_for(0.9 * value, np.array([0, 1.0, 0])).mirrors == (ACROSS_X,)
    assert path.segments.pad_for(value, np.array([1.0, 0, 0])).mirrors == (ACROSS_Y,)
    assert path.segments.pad_for(value, np.array([0, 1.0, 0])).mirrors == ()


@pytest.fixture
def beside():
    """Two bodies, as far from the upper part of a column as it may lean."""
    pytest.importorskip("ipctk")
    places = [trimesh.transformations.translation_matrix((side * (1 + LEAN), 0, 15)) for side in (1, -1)]
    return np.concatenate([trimesh.creation.box((1, 4, 6), place).triangles for place in places])


def held(load, lean):
    """Force across it on the end of a column that leans so far, clamped below, relative to its load (S. P. Timoshenko
    and J. M. Gere, Theory of Elastic Stability, 1961, section 1.3)."""
    k = np.pi / 2 * np.sqrt(load) / LENGTH
    return lean / (np.tan(k * LENGTH) / k - LENGTH)


def test_a_column_leans_on_what_it_touches(columns, beside):
    """Beyond Euler's load the body beside holds it; states do not depend on what is asked before."""
    law, load = NeoHookean(MODULUS, 0.0), SpreadForce(self_contact=True)

    def pressed(*loads):
        values = [(0, 0, -share * EULER) for share in loads]
        return load_path(Pad(), law, values, load=load, mesh_size=1.0, obstacles=beside)

    before, *states = pressed(1.0013, 2, 4)
    assert not Contacts(before.mesh, MODULUS, before.bodies).all_forces(before.displacement).any()
    for state in states:
        assert state.stability_checked and state.buckled_at == pytest.approx((0, 0, -EULER), rel=0.005)
        places = state.mesh.points + state.displacement
        top = state.mesh.points[:, 2] == LENGTH
        assert 0.9 * LEAN < places[top, 0].mean() and places[:, 0].max() < 0.5 + LEAN
        other = Contacts(state.mesh, MODULUS, state.bodies).forces(state.displacement)[1][:, 0].sum()
        at = -state.value[2] / EULER
        assert other / -state.value[2] == pytest.approx(held(at, state.displacement[top, 0].mean()), rel=0.02, abs=1e-4)
        rate = state.path_rate()
        along = linearise(state).by_value(rate.direction)
        np.testing.assert_allclose(rate.displacement, along, atol=1e-6 * np.abs(along).max())
    (alone,) = load_path(Pad(), law, [states[0].value], load=load, mesh_size=1.0, obstacles=beside[: len(beside) // 2])
    np.testing.assert_allclose(alone.displacement, states[0].displacement, atol=1e-4 * LEAN)  # one is enough
    columns()
    np.testing.assert_array_equal(pressed(4)[0].displacement, states[-1].displacement)


def test_readings_are_continuous_as_a_buckled_wall_touches_the_package(fresh, monkeypatch, thin_walled):
    """Two walls bend inwards from 0.051 mm on, and lean on the package from 0.067 mm on; the others bend outwards."""
    pytest.importorskip("ipctk")
    pad = Pad(rows=1, columns=1, wall=0.12, cell_size=2.0, cell_height=1.2, height=1.6, pitch=2.12)
    monkeypatch.setattr(path_problem, "pad_mesh", lambda pad, size: thin_walled(pad, 2, 4))
    depths, read, error, pushed = 0.067 + 3e-3 * np.arange(-2, 3), [], [], []
    reflector, load = PhotoReflector(body=(1.8, 1.8, 0.7)), PlateDisplacement(self_contact=True)
    for depth in depths:
        live = PadSensor(pad, photo_reflector=reflector, force=(0, 0, -depth), load=load).scene().load()
        readings = measure(live, points=1 << 12, mechanics_error=False)
        (state,) = (shape.state for shape in loaded_pads(live))
        contacts = Contacts(state.mesh, NeoHookean().youngs_modulus, state.bodies)
        read.append(readings.power[0])
        error.append(readings.standard_error[0])
        pushed.append(np.abs(contacts.all_forces(state.displacement)).sum())
        assert state.buckled_at[2] == pytest.approx(-0.0506, rel=0.01) and state.stability_checked
    assert pushed[0] == 0 and pushed[4] > 1e-3
    curve = np.polynomial.Polynomial.fit(depths, read, 2)
    assert np.abs(read - curve(depths)).max() < 4 * max(error)  # false alarm below 3e-4
    assert np.ptp(read) > 40 * max(error)


def test_a_column_under_a_plane_ends_where_it_buckles(columns):
    """That keeps its end upright and lets it slide, so that it bears four times Euler's load (Timoshenko and Gere,
    section 2.2); branches are not followed there."""
    shortened = 4 * EULER * LENGTH / (MODULUS * WIDTH)
    with pytest.raises(ComputationError, match=r"the equilibrium is unstable .* the load path ends at displ") as end:
        load_path(
            Pad(), NeoHookean(MODULUS, 0.0), [(0, 0, -0.1)], load=IndenterDisplacement(Indenter("plane")), mesh_size=1.0
        )
    assert 0.75 * shortened < -end.value.value[2] < 1.02 * shortened


def test_a_column_ends_in_time_where_it_buckles(columns):
    """States that are asked for are judged, however little the pad has moved; branches are not followed in time."""
    silicone = Viscoelastic(NeoHookean(MODULUS, 0.0), ((0.5, 1.0),))

    def loaded(*shares):
        values = [(0, 0, -share * EULER) for share in shares]
        return load_path(Pad(), silicone, values, times=0.1 * np.arange(1, 1 + len(shares)), mesh_size=1.0)

    assert all(state.stability_checked for state in loaded(0.5, 0.9))
    with pytest.raises(ComputationError, match=r"the equilibrium is unstable .* the load path ends at force"):
        loaded(0.5, 1.05)


def test_a_load_that_falls_ends_the_path():
    """A single cell leans, and its load falls at once: that is the end of a force, and is named with the load."""
    with pytest.raises(ComputationError, match=r"the load falls as the pad buckles\): the load path ends at") as end:
        load_path(Pad(rows=1, columns=1), NeoHookean(), [(0, 0, -40)], mesh_size=2.5)
    assert end.value.value[2] == pytest.approx(-17, rel=0.1)
