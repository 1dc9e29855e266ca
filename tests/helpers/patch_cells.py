"""Plates and domes of patches, with an LED and a phototransistor, made without a scene."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.laws.ends import CosineFactor, End, uniform_cone
from mitsuba_taxel.transport.patches import LATTICE
from mitsuba_taxel.transport.rules import rectangle_rule, square_annulus_rule

UP = np.array([0.0, 0.0, 1.0])
LAMBERTIAN, CONE = CosineFactor(1 / math.pi, 1.0), uniform_cone(math.cos(math.radians(88)))


def led(spacing, law, hole=0.0, points=3):
    at, weights = square_annulus_rule(0.25, hole, points, points)
    return End(np.column_stack([at - (spacing / 2, 0), np.zeros(len(at))]), weights / weights.sum(), UP, law)


def phototransistor(spacing):
    at, weights = rectangle_rule(0.52, 0.3, 8, 8)
    return End(np.column_stack([at + (spacing / 2, 0), np.zeros(len(at))]), weights, UP, CosineFactor(1.0, 0.0))


def patches(corners):
    """(F, 15, 3) flat patches with such corners (F, 3, 3)."""
    return np.column_stack([1 - LATTICE.sum(axis=1), LATTICE]) @ corners


def plate(side, height, count=4):
    """A square plate that faces down, cut into triangles."""
    lines = np.linspace(-side / 2, side / 2, count + 1)
    corners = []
    for x, y in np.ndindex(count, count):
        a, b, c, d = ((lines[x + i], lines[y + j], height) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
        corners += [(a, c, b), (a, d, c)]
    return patches(np.array(corners))


def dome(radius, rim, count=3):
    """The cap of a sphere round the axis, wide 1.275 mm at the height ``rim``, as patches that face its middle."""
    weights = np.column_stack([1 - LATTICE.sum(axis=1), LATTICE])
    places = []
    for triangle in hexagon(count):
        disc = weights @ triangle
        on_rim = np.flatnonzero(np.linalg.norm(triangle, axis=1) > 1 - 1e-9)
        if len(on_rim) == 2:  # one side is an arc
            one, other = weights[:, on_rim].T
            share = np.divide(other, one + other, out=np.full_like(one, 0.5), where=one + other > 0)[:, None]
            chord = triangle[on_rim[0]] + share * (triangle[on_rim[1]] - triangle[on_rim[0]])
            bulge = chord / np.linalg.norm(chord, axis=1, keepdims=True) - chord
            disc = disc + ((one + other) ** 2)[:, None] * bulge
        polar = np.linalg.norm(disc, axis=1) * math.asin(1.275 / radius)
        outwards = math.asin(1.275 / radius) * np.sinc(polar / math.pi)[:, None] * disc
        middle = rim - math.sqrt(radius**2 - 1.275**2)
        places.append(np.column_stack([radius * outwards, middle + radius * np.cos(polar)]))
    return np.array(places)


def hexagon(count):
    """(F, 3, 2) triangles within the unit circle, whose rim they meet with corners only, clockwise."""
    rings = [[np.zeros(2)]]
    for ring in range(1, count + 1):
        turn = 2 * math.pi * np.arange(6 * ring) / (6 * ring)
        rings.append(list(ring / count * np.column_stack([np.cos(turn), np.sin(turn)])))
    triangles = []
    for ring in range(1, count + 1):
        inner, outer = rings[ring - 1], rings[ring]
        for k in range(6):
            for i in range(ring):
                a, b = outer[k * ring + i], outer[(k * ring + i + 1) % len(outer)]
                c = inner[(k * (ring - 1) + i) % len(inner)]
                triangles.append((a, c, b))
                if i < ring - 1:
                    triangles.append((b, c, inner[(k * (ring - 1) + i + 1) % len(inner)]))
    return np.array(triangles)


def cell(places, isotropic, spacing, law, rest=None, degree=2, hole=0.0, reflectance=1.0):
    shares = [np.full(len(places), reflectance * share) for share in (isotropic, 1 - isotropic)]
    rest = places if rest is None else rest
    walls = ScatteringWalls(places, rest, *shares)
    return Cell(Mesh(rest, degree), walls, led(spacing, law, hole), phototransistor(spacing))
