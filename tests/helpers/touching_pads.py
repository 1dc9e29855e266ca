"""A pad of one cell that touches itself, the board or a package: its loads, and what it stores."""

from __future__ import annotations

import numpy as np
import trimesh

from mitsuba_taxel.mechanics import NeoHookean, PlateDisplacement, load_path
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.equilibrium.feet import near_feet
from mitsuba_taxel.pads import REGIONS, Pad

PAD, LAW, ON = Pad("parallelepiped", rows=1, columns=1), NeoHookean(), PlateDisplacement(self_contact=True)
ASIDE, BEFORE, BEYOND = (0.5, 0, -0.4), (0, 0, -0.9), (0, 0, -1.8)
"""Displacements beside that of -1.48 mm at which the pad touches itself and the board."""
TOP = 1.201
"""Height of a package under the roof in mm."""
PACKAGE = trimesh.creation.box((1.0, 1.4, 1.2), trimesh.transformations.translation_matrix((0, 0, 0.601))).triangles
CLEAR, HELD = (0, 0, -0.4), (0, 0, -0.56)
"""Displacements beside that of -0.47 mm at which the roof touches it."""
SIZE, SMALL = 2.5, 2.0
"""Of elements in mm, also where more is asked of them."""


def pressed(*values, load=ON, material=LAW, size=SIZE, **more):
    return load_path(PAD, material, values, load=load, mesh_size=size, **more)


def lowest(state, over=np.inf):
    """mm, of the nodes of the roof, or of those over a rectangle, by half its sides."""
    roof = np.unique(state.mesh.faces[state.mesh.face_region == REGIONS["roof"]])
    places = (state.mesh.points + state.displacement)[roof]
    return places[np.all(np.abs(places[:, :2]) <= over, axis=1), 2].min()


def stored(state):
    """N mm, energy of the silicone, whose law is linear at its feet."""
    mesh, here = state.mesh, slice(None)
    elements = Assembly(mesh, LAW, number_unknowns(mesh, np.zeros(len(mesh.points), bool))).elements
    gradient = elements.gradient(here, state.displacement) + np.eye(3)
    pressure = elements.pressures(here, state.pressure)
    strain = (gradient + np.swapaxes(gradient, -1, -2)) / 2 - np.eye(3)
    squares = (strain**2).sum(axis=(-2, -1)) - np.trace(strain, axis1=-2, axis2=-1) ** 2 / 3
    isochoric = np.where(near_feet(mesh), LAW.shear_modulus * squares, LAW.energy(gradient))
    return (elements.weight * (isochoric + LAW.compressibility / 2 * pressure**2)).sum()
