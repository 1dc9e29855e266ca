"""Bodies pressed on blocks, against closed forms.

The bonded layer of thickness H under a contact is stiffer than a half-space: to first order by a shift of the depth of
0.5665 F / (E* H) for rubber (E. K. Dimitriadis et al., Biophys. J. 82, 2002, equation 10, whose first term it is).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipk

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS, mirrored
from mitsuba_taxel.geometry.refinement import refined
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.solution import NO_HISTORY, History, Rejected
from mitsuba_taxel.mechanics.results.contact_pressure import smooth_pressure

LAW = NeoHookean(1.0, 0.49)
MODULUS = 1 / (1 - 0.49**2)
HEIGHT, RADIUS = 80.0, 100.0


@pytest.fixture
def half_space(symmetric_block):
    """A function that makes blocks 80 mm high and ``width`` of that wide with small elements where it is asked for."""

    def make(size, width=2.0):
        mesh = symmetric_block((width * HEIGHT, width * HEIGHT, HEIGHT), (1, 1, 1))
        mesh = part_between(mesh, node_images(mesh), MIRRORS).mesh
        mesh = refined(mesh, lambda places: size(places - [0, 0, HEIGHT]))
        for mirror in (ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y):
            mesh = mirrored(mesh, mirror)
        order = np.concatenate([np.unique(mesh.tets[:, :4]), np.unique(mesh.tets[:, 4:])])
        number = np.argsort(order)
        return replace(mesh, points=mesh.points[order], tets=number[mesh.tets], faces=number[mesh.faces])

    return make


class Pressed:
    """A block pressed deeper and deeper by a body."""

    def __init__(self, mesh, body, material=LAW, mirrors=MIRRORS):
        load, images = IndenterDisplacement(body), node_images(mesh)
        self.pad = IndentedPad(mesh, material, load, mirrors, {mirror: images[mirror] for mirror in mirrors})
        self.unknowns, self.depth, self.tangent = np.zeros(self.pad.unknowns), 0.0, 0.0

    def to(self, depth):
        value = np.array([0.0, 0.0, -depth])
        start = self.unknowns + (depth - self.depth) * self.tangent
        solution, linearised = self.pad.solve(start, value)
        self.unknowns, self.depth = solution.unknowns, depth
        self.tangent = self.pad.rate(linearised, self.unknowns, np.array([0.0, 0.0, -1.0]), value)
        displacement = self.pad.numbering.split(self.unknowns)[0]
        body = self.pad.model.indentation
        self.pressing = body.contact_state(displacement, value)
        self.places = (self.pad.part.mesh.points + displacement)[body.node]
        return self

    @property
    def force(self):
        return -self.pad.part.copies * float(self.pressing.force[2])

    @property
    def contact_radius(self):
        """mm, of the half-ellipsoid whose pressure has the mean square of the distance from the axis."""
        displacement = self.pad.numbering.split(self.unknowns)[0]
        squared = ((self.pad.part.mesh.points + displacement)[:, :2] ** 2).sum(axis=1)
        body, pressure = self.pad.model.indentation, self.pressing.pressure
        return np.sqrt(2.5 * (pressure @ (body.carried @ squared)) / (pressure @ body.area))

    @property
    def energy(self):
        """N mm, in the block, and in what the body sinks in."""
        displacement, pressure = self.pad.numbering.split(self.unknowns)
        elements, law, here = self.pad.model.assembly.elements, self.pad.material, slice(None)
        density = law.energy(elements.gradient(here, displacement) + np.eye(3))
        density = density + law.compressibility / 2 * elements.pressures(here, pressure) ** 2
        sunk = self.pad.model.indentation.slack * self.pressing.pressure**2
        return self.pad.part.copies * ((elements.weight * density).sum() + sunk.sum() / 2)


def test_a_ball_presses_as_hertz_says(half_space):
    mesh = half_space(lambda places: 0.5 * np.maximum(1.0, np.linalg.norm(places, axis=1)), width=4.0)
    block = Pressed(mesh, Indenter("sphere", radius=RADIUS))
    for depth in (0.01, 0.02):  # elements of half the contact's radius; small strains
        block.to(depth)
        relative = np.sqrt(RADIUS * depth) / HEIGHT
        layer = 1 + 1.133 * relative + 1.283 * relative**2
        expected = 4 / 3 * MODULUS * np.sqrt(RADIUS) * depth**1.5 * layer
        assert block.force == pytest.approx(expected, rel=5e-3)
        assert block.contact_radius == pytest.approx(np.sqrt(RADIUS * depth), rel=1e-2)
        sunk = -block.pressing.gap / block.pad.model.indentation.area
        assert sunk.max() < 1e-3 * depth
        assert_spread_as_a_half_ellipsoid(block, np.sqrt(RADIUS * depth))


def test_an_ellipsoid_presses_as_hertz_says_of_elliptic_contacts(half_space):
    """Of depths shifted by the bonded layer; lengths of the contact are those of its half-ellipsoid of pressure."""
    body = Indenter("ellipsoid", semi_axis_x=200.0, semi_axis_y=100.0, semi_axis_z=200.0)  # radii of 200 and 50 mm
    larger, smaller = body.body._contact(0.02)
    near = partial(body.body.distance_to_steepest_pressure, depth=0.02)
    mesh = half_space(lambda places: 0.7 * np.maximum(smaller, near(places)), width=4.0)
    block = Pressed(mesh, body, mirrors=(ACROSS_X, ACROSS_Y)).to(0.02)
    shifted = 0.02 + 0.5665 * block.force / (MODULUS * HEIGHT)
    widths = np.array([larger, smaller]) * np.sqrt(shifted / 0.02)
    expected = 2 / 3 * np.pi * widths[0] * shifted * MODULUS / ellipk(1 - (smaller / larger) ** 2)
    assert block.force == pytest.approx(expected, rel=1e-2)
    displacement = block.pad.numbering.split(block.unknowns)[0]
    squared = ((block.pad.part.mesh.points + displacement)[:, :2] ** 2).T
    body, pressure = block.pad.model.indentation, block.pressing.pressure
    found = [np.sqrt(5 * (pressure @ (body.carried @ along)) / (pressure @ body.area)) for along in squared]
    np.testing.assert_allclose(found, widths, rtol=0.02)


def layer_factor(relative, nu=0.49):
    """Force of a ball on a bonded layer, relative to Hertz's, for a contact of such a radius relative to the layer (E.
    K. Dimitriadis et al., 2002, equations 9 to 13)."""
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1 - nu)
    x, second, third = relative / np.pi, a**3 + 4 * np.pi**2 / 15 * b, a**3 + 3 * np.pi**2 / 5 * b
    return 1 - 2 * a * x + 4 * a**2 * x**2 - 8 * second * x**3 + 16 * a * third * x**4


@pytest.mark.parametrize(("fraction", "within"), [(0.5, 5e-3), (0.25, 3e-3)])
def test_a_contact_of_a_twentieth_of_the_ball(half_space, fraction, within):
    """On elements of that fraction of the contact's radius; the block is eight times as wide as high."""
    contact = 0.05 * RADIUS

    def size(places):
        return fraction * contact + 0.7 * np.maximum(0, np.linalg.norm(places, axis=1) - 1.2 * contact)

    block, depth = Pressed(half_space(size, width=8.0), Indenter("sphere", radius=RADIUS)), contact**2 / RADIUS
    block.to(0.6 * depth).to(depth)
    hertz = 4 / 3 * MODULUS * contact**3 / RADIUS
    assert block.force == pytest.approx(hertz * layer_factor(contact / HEIGHT), rel=within)
    of_force = np.cbrt(0.75 * block.force * RADIUS / MODULUS)
    assert block.contact_radius == pytest.approx(of_force, rel=5e-3)


def assert_spread_as_a_half_ellipsoid(block, radius):
    body, pressed = block.pad.model.indentation, block.pressing.pressure
    pressure = smooth_pressure(body, pressed)
    from_centre = np.linalg.norm(block.places[:, :2], axis=1) / radius
    highest = 1.5 * block.force / (np.pi * radius**2)
    off = pressure / highest - np.sqrt(np.maximum(1 - from_centre**2, 0))
    within = from_centre < 0.85
    assert np.abs(off[within]).max() < 0.06
    assert np.sqrt(np.average(off[within] ** 2, weights=body.area[within])) < 0.02
    assert pressure.max() == pytest.approx(highest, rel=0.02)
    assert body.area @ pressure == pytest.approx(body.area @ pressed)
    assert not pressure[pressed == 0].any()


@pytest.mark.parametrize("few", [0, 1, 2, 3, 8, 1000])
def test_even_pressures_stay_even(block, few):
    body = Indentation(block((1.0, 1.0, 1.0), (2, 2, 2), distortion=0.2), Indenter("plane"), 1.0)
    even = np.where(np.arange(len(body.area)) < few, 2.0, 0.0)
    np.testing.assert_allclose(smooth_pressure(body, even), even, atol=1e-9)


def of_punch(radius, edge, depth):
    """Force on a flat punch with a parabolic edge and radius of its contact (V. L. Popov et al., Handbook of Contact
    Mechanics, 2019, section 2.5.7)."""
    flat = radius - edge

    def profile(x):  # of the equivalent one-dimensional punch
        return x / edge * (np.sqrt(x**2 - flat**2) - flat * np.arccos(flat / x))

    def force(deep):
        touching = brentq(lambda x: profile(x) - deep, flat, radius)
        return 2 * MODULUS * (deep * touching - quad(profile, flat, touching)[0]), touching

    expected = force(depth)
    for _ in range(5):
        expected = force(depth + 0.5665 * expected[0] / (MODULUS * HEIGHT))
    return expected


def edged(smallest, size):
    """Sizes of elements under a punch of 1 mm: ``size`` times the distance from its edge, within 2 mm."""

    def sizes(places):
        from_edge = np.hypot(np.hypot(places[:, 0], places[:, 1]) - 1.0, places[:, 2])
        return np.where(np.linalg.norm(places, axis=1) < 2.0, size * np.maximum(smallest, from_edge), 0.7 * from_edge)

    return sizes


def test_a_punch_presses_as_its_closed_form_says(half_space):
    block = Pressed(half_space(edged(0.35, 0.5)), Indenter("punch", radius=1.0, edge_radius=0.2))
    assert block.to(0.02).force == pytest.approx(of_punch(1.0, 0.2, 0.02)[0], rel=1e-2)


def test_a_tilted_punch_is_turned_back_as_its_closed_form_says(half_space):
    """To first order, the contact stays a circle, of which a tilt needs a moment of 4/3 E* a^3 (K. L. Johnson, Contact
    Mechanics, 1985, section 3.3)."""
    tilt = 0.05
    body = Indenter("punch", radius=1.0, edge_radius=0.2, tilt=tilt)
    force, contact = of_punch(1.0, 0.2, 0.02)
    block = Pressed(half_space(edged(0.5, 0.7)), body, mirrors=(ACROSS_Y,)).to(0.02 + body.body.lift)
    displacement = block.pad.numbering.split(block.unknowns)[0]
    places = block.pad.part.mesh.points + displacement - [0, 0, HEIGHT - 0.02]
    moment = 2 * np.cross(places, block.pressing.nodal_forces)[:, 1].sum()
    expected = 4 / 3 * MODULUS * contact**3 * np.radians(tilt)
    assert [block.force, moment] == pytest.approx([force, expected], rel=3e-2)  # 1 % on elements of 0.7 times the size
    assert moment / block.force == pytest.approx(expected / force, rel=3e-3)


@pytest.mark.parametrize(("tilt", "edge"), [(15.0, 0.05), (30.0, 0.1)])
def test_a_body_presses_with_an_edge_that_is_sharper_than_elements(symmetric_block, tilt, edge):
    """At once, to a stable state that stores what the body does; pressures that turn make its linear pad unstable."""
    body = Indenter("punch", radius=1.0, edge_radius=edge, tilt=tilt)
    mesh = symmetric_block((4.0, 4.0, 2.0), (4, 4, 2))
    block, depths, energies, forces = Pressed(mesh, body, NeoHookean(), (ACROSS_Y,)), (0.1995, 0.2, 0.2005), [], []
    for depth in depths:
        block.to(depth)
        energies.append(block.energy)
        forces.append(block.force)
    done = (depths[2] - depths[0]) * (forces[0] + 4 * forces[1] + forces[2]) / 6
    assert energies[2] - energies[0] == pytest.approx(done, rel=1e-5)


def test_a_block_slips_off_a_ball_that_is_sharper_than_elements(symmetric_block):
    mesh = symmetric_block((4.0, 4.0, 2.0), (3, 3, 2))
    sharp, round_ = (Pressed(mesh, Indenter("sphere", radius=radius), NeoHookean(), ()) for radius in (0.3, 1.0))
    for depth in (0.1, 0.2):
        assert round_.to(depth).force > sharp.to(depth).force > 0
    assert round_.to(0.25).force > 0
    with pytest.raises(Rejected, match="it slips off the indenter, whose edge is too sharp for the elements"):
        sharp.to(0.25)


def test_a_plate_presses_evenly(block):
    mesh = block((1.0, 1.0, 1.0), (2, 2, 2), distortion=0.2, curvature=0.05)
    material, depth = NeoHookean(2.0, 0.0), 1e-5
    pressed = Pressed(mesh, Indenter("plane"), material, ()).to(depth)
    assert pressed.force == pytest.approx(2.0 * depth, rel=2e-3)
    displacement, _ = pressed.pad.split(pressed.unknowns)
    np.testing.assert_allclose(displacement, -depth * mesh.points * [0, 0, 1], atol=2e-3 * depth)


def test_a_plate_slides_under_its_own_bound(block):
    """It sticks at first; once all slides, each traction is the coefficient times the pressure, along the way."""
    mesh, friction = block((1.0, 1.0, 0.5), (3, 3, 2)), 0.4
    dragged = Rubbed(mesh, Indenter("plane", friction=friction), NeoHookean(2.0, 0.3), ())
    pressed = dragged.drag(0, 0, -0.02)[2]
    sticking = dragged.drag(1e-3, 0, -0.02)
    assert 0 < -sticking[0] < 0.2 * friction * pressed
    for value in ((0.1, 0, -0.02), (0.3, 0, -0.02)):
        force = dragged.drag(*value)
    assert -force[0] == pytest.approx(friction * force[2], rel=1e-5)  # its sides bulge a little, across the way
    size = np.linalg.norm(dragged.history.friction_state.traction, axis=1)
    np.testing.assert_allclose(size, friction * dragged.pressing.pressure, rtol=1e-6)
    back = dragged.drag(-0.3, 0, -0.02)
    np.testing.assert_allclose(back * [-1, 1, 1], force, atol=2e-2 * pressed)


class Rubbed(Pressed):
    """A block that a body is pressed and dragged on."""

    factored, history = 0, NO_HISTORY

    def drag(self, *value):
        """(3,) force on the body from the whole block, after a step to a pose."""
        value, near = np.array(value), getattr(self, "near", None)
        solution, self.near = self.pad.solve_after(self.unknowns, value, near, self.history)
        rubbed = self.pad.friction_state_at(solution.unknowns, value, self.history)
        self.unknowns, self.history = solution.unknowns, History(friction_state=rubbed)
        displacement, body = self.pad.numbering.split(self.unknowns)[0], self.pad.model.indentation
        self.pressing = body.contact_state(displacement, value, traction=rubbed.traction)
        return -self.pad.part.copies * self.pressing.force


@pytest.mark.parametrize(("friction", "way", "depth"), [(0.6, (0.5**0.5, 0.5**0.5), 0.02), (0.1, (0, -1), 0.01)])
def test_a_ball_is_dragged_as_cattaneo_and_mindlin_say(half_space, friction, way, depth):
    """There and back: R. D. Mindlin, J. Appl. Mech. 16, 1949, and with H. Deresiewicz, 20, 1953; K. L. Johnson, Contact
    Mechanics, 1985, sections 7.2 and 7.4."""
    radius = np.sqrt(RADIUS * depth)
    mesh = half_space(lambda places: np.maximum(0.4 * radius, 0.8 * np.linalg.norm(places, axis=1)), width=4.0)
    (mirror,) = (mirror for mirror in MIRRORS if mirror.side(np.array([*way, 0.0])) == 0)
    block = Rubbed(mesh, Indenter("sphere", radius=RADIUS, friction=friction), mirrors=(mirror,))
    counted, shear_modulus = block.pad._factored, 1 / 2.98
    block.pad._factored = lambda lower: setattr(block, "factored", block.factored + 1) or counted(lower)
    most = friction * block.drag(0, 0, -depth)[2]
    slides = 3 * most * (2 - 0.49) / (16 * radius * shear_modulus)

    def held(share):
        return 1 - max(0.0, 1 - share) ** 1.5

    there_and_back = held(0.8) - 2 * held(0.5)  # without memory, -held(0.2)
    for share, expected, tolerance in ((0.8, held(0.8), 1e-2), (-0.2, there_and_back, 1e-2), (1.5, 1.0, 1e-3)):
        force = block.drag(*(share * slides * np.array(way)), -depth)
        assert -force[:2] @ way / (friction * force[2]) == pytest.approx(expected, abs=tolerance)
    assert block.factored <= 10
