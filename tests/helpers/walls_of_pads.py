"""Pads of every shape of cell, the distance of meshes from their walls, and their volumes."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls
from mitsuba_taxel.pads.regions import REGIONS

PADS = {shape: Pad(shape, rows=1, columns=2) for shape in CELL_SHAPES}
PADS["profile"] = Pad("profile", rows=1, columns=2, profile="0.95 0.4; 0.9 0.7; 0.7 1; 0.3 1; 0 0.8")
PADS["square"] = replace(PADS["profile"], section="square")
PADS["frustum"] = Pad("frustum", rows=1, columns=2)


def off_the_walls(pad, mesh):
    """(B, 6) mm, how far each node of each face is from the region of the pad's surface that the face is of."""
    points, half = mesh.points[mesh.faces], 0.5 * np.array(pad.extent)
    lean = np.array([pad.top_x, pad.top_y]) / pad.cell_height
    points[..., :2] -= np.where(mesh.face_cell[:, None, None] > 0, points[..., 2:] * lean, 0.0)
    if pad.cell == "profile":
        region, cell = (np.repeat(each, 6) for each in (mesh.face_region, mesh.face_cell))
        flat, upright = points.reshape(-1, 3), replace(pad, top_x=0.0, top_y=0.0)
        return np.linalg.norm(onto_round_walls(upright, flat, region, cell)[0] - flat, axis=1)
    within = points[..., :2] - np.array([(0.0, 0.0), *pad.cell_centres])[mesh.face_cell][:, None]
    size = np.abs(within).max(axis=2) if pad.cell == "parallelepiped" else np.linalg.norm(within, axis=2)
    to_roof = points[..., 2] - pad.top_of_cell
    if "roof" in pad.shape.round_regions:
        to_roof = np.hypot(size, to_roof + pad.shape.roof_radius) - pad.shape.roof_radius
    to_side = size - 0.5 * pad.cell_size
    if pad.cell == "frustum":
        slope = 0.5 * (pad.cell_size - pad.roof_size) / pad.cell_height
        to_side = (to_side + slope * points[..., 2]) / math.hypot(1.0, slope)
    to_outer = np.min(np.abs(np.abs(points[..., :2]) - half[:2]).max(axis=1, keepdims=True), axis=2)
    distances = {
        "roof": to_roof,
        "side": to_side,
        "bottom": points[..., 2],
        "top": points[..., 2] - pad.height,
        "outer": to_outer,
    }
    return np.abs(sum(np.where(mesh.face_region[:, None] == REGIONS[name], d, 0.0) for name, d in distances.items()))


def volume(pad):
    if pad.cell == "profile":
        return math.prod(pad.extent) - pad.rows * pad.columns * hollow(pad)
    if pad.cell == "frustum":
        bottom, roof = 0.5 * pad.cell_size, 0.5 * pad.roof_size
        cone = math.pi / 3 * pad.cell_height * (bottom**2 + bottom * roof + roof**2)
        return math.prod(pad.extent) - pad.rows * pad.columns * cone
    cap = pad.top_of_cell - pad.side_height
    base = pad.cell_size**2 if pad.cell == "parallelepiped" else math.pi * (0.5 * pad.cell_size) ** 2
    cell = base * pad.side_height
    if cap:
        cell += math.pi * cap**2 * (pad.shape.roof_radius - cap / 3)
    return math.prod(pad.extent) - pad.rows * pad.columns * cell


def hollow(pad):
    """Volume of a cell with a profile, of whose meridian r^2 is polynomial: Gauss's rule is exact on each piece."""
    section = 4.0 if pad.section == "square" else math.pi
    total = 0.0
    for curve in (pad.shape.roof, pad.shape.side):
        nodes, weights = np.polynomial.legendre.leggauss(6)
        for low, high in pairwise(curve.square.x):
            s = low + (high - low) * (nodes + 1) / 2
            total -= 0.5 * (high - low) * weights @ (section * curve.square(s) * curve.height(s, 1))
    return total
