"""What a load does along a path is stored in the pad, and what the pad encloses is what its elements fill."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson

from mitsuba_taxel.mechanics import (
    MooneyRivlin,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    Yeoh,
    load_path,
    tessellate,
)
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.elements import QUADRATURE_POINTS
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces
from mitsuba_taxel.pads import REGIONS, Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

PAD, CURVED = Pad(rows=1, columns=1), Pad("hemispheric", rows=1, columns=1)
SIZE = 3.0


class Deformed:
    """Fields at the quadrature points of a state."""

    def __init__(self, state) -> None:
        mesh = state.mesh
        self.state, self.places = state, mesh.points + state.displacement
        self.free = Assembly(mesh, state.material, number_unknowns(mesh, np.zeros(len(mesh.points), dtype=bool)))
        self.weight, elements = self.free.elements.weight, self.free.elements
        nodal = state.displacement[elements.nodes]
        self.gradient = np.eye(3) + np.einsum("mai,mqaj->mqij", nodal, elements.gradients)
        corners = np.concatenate([1 - QUADRATURE_POINTS.sum(axis=1, keepdims=True), QUADRATURE_POINTS], axis=1)
        self.pressure = state.pressure[mesh.tets[:, :4]] @ corners.T

    def integral(self, values):
        return np.sum(self.weight * values)

    @property
    def energy(self):
        """Stored energy [N mm]: isochoric, and kappa/2 (J - 1)² by the pressure field p = kappa (J - 1)."""
        material = self.state.material
        return self.integral(material.energy(self.gradient) + material.compressibility / 2 * self.pressure**2)

    @property
    def volume(self):
        return self.integral(np.linalg.det(self.gradient))

    @property
    def enclosed(self):
        """Volume [mm³] inside the curved surface, by the divergence theorem."""
        return self._enclosed_by(self.state.mesh.faces)

    def _enclosed_by(self, faces):
        return -(pressure_forces(self.places[faces]) * self.places[faces]).sum() / 3

    def under_the_load(self):
        """Force [N] and the displacement [mm] that it works on; or minus the pressure [MPa] and the volume [mm³]."""
        mesh, load = self.state.mesh, self.state.load
        if isinstance(load, Pressure):
            faces = mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]
            return -self.state.value, np.array([self._enclosed_by(faces)])
        top = np.unique(mesh.faces[mesh.face_region == REGIONS["top"]])
        if load.bonded_plate:
            residual = self.free.evaluate(self.state.displacement, self.state.pressure, with_tangent=False).residual
            forces = residual[: self.places.size].reshape(-1, 3)
            return forces[top].sum(axis=0), self.state.displacement[top[0]]
        share = load.nodal(mesh)
        return self.state.value, share @ self.state.displacement / share.sum()


def work(states):
    """Work [N mm] along states at equal steps of the load, by Simpson's rule."""
    forces, moves = (np.array(column) for column in zip(*(state.under_the_load() for state in states), strict=True))
    along = np.linspace(0, 1, len(states))
    if isinstance(states[0].state.load, PlateDisplacement):
        return simpson(forces @ (moves[-1] - moves[0]), x=along)
    # By parts, as it is the force that grows evenly.
    return forces[-1] @ moves[-1] - forces[0] @ moves[0] - simpson(moves @ (forces[-1] - forces[0]), x=along)


LEGS = [
    (SpreadForce(), (0, 0, 0), (0, 0, -1.6)),
    (SpreadForce(), (0, 0, 0), (0, 0, 1.6)),
    (SpreadForce(), (0, 0, -1.0), (0.4, 0.2, -1.0)),
    (PatchForce((0, 0), (1, 1)), (0, 0, 0), (0, 0, -0.5)),
    (PlateForce(), (0, 0, 0), (0, 0, -1.6)),
    (PlateDisplacement(), (0, 0, 0), (0, 0, -0.15)),
    (PlateDisplacement(), (0, 0, -0.1), (0.15, 0, -0.1)),
    (Pressure(), (0,), (0.1,)),
]
LAWS = [NeoHookean(), MooneyRivlin(0.5, 0.2, 0.4999), Yeoh(0.7, 0.1, 0.02, 0.3)]


@pytest.mark.parametrize(
    ("load", "start", "end", "law"), [(*segment, LAWS[k % 3]) for k, segment in enumerate(LEGS)], ids=str
)
def test_the_work_of_a_load_is_stored(load, start, end, law):
    """On a normal segment, and on a tangential one, whose dead force works against nothing but the pad.

    States between the nodes of a segment are interpolated; the work is known as well as their displacements.
    """
    states = [Deformed(state) for state in load_path(PAD, law, np.linspace(start, end, 5), load=load, mesh_size=SIZE)]
    stored = states[-1].energy - states[0].energy
    assert stored > 1e-3
    assert work(states) == pytest.approx(stored, rel=2e-4)


@pytest.mark.parametrize(
    ("pad", "load", "value", "law"),
    [
        (PAD, SpreadForce(), (0.4, 0.2, -1.0), LAWS[2]),
        (PAD, PlateForce(), (0, 0, -1.6), LAWS[1]),
        (PAD, PlateDisplacement(), (0.15, 0, -0.1), LAWS[0]),
        (CURVED, SpreadForce(), (0, 0, -1.6), LAWS[0]),
        (CURVED, Pressure(), (0.1,), LAWS[2]),
    ],
    ids=lambda part: part.cell if isinstance(part, Pad) else str(part),
)
def test_elements_fill_the_deformed_surface(pad, load, value, law):
    """J integrated is the volume inside, which changes by the pressure field over kappa; facets come near to it.

    Not nearer than 2e-3 on this coarse mesh, as each face of the bulging outside is four flat triangles.
    """
    (state,) = load_path(pad, law, [value], load=load, mesh_size=SIZE)
    deformed = Deformed(state)
    rest = Deformed(replace(state, displacement=0 * state.displacement, pressure=0 * state.pressure))
    assert deformed.volume == pytest.approx(deformed.enclosed, rel=1e-13)
    growth = law.compressibility * deformed.integral(deformed.pressure)
    assert deformed.volume - rest.volume == pytest.approx(growth, rel=1e-3)
    surface = tessellate(state)
    one, two, three = np.moveaxis(surface.vertices[surface.triangles], 1, 0)
    assert np.sum(one * np.cross(two, three)) / 6 == pytest.approx(deformed.volume, rel=2e-3)
