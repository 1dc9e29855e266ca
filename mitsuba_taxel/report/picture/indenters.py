"""Surfaces of the bodies that press on pads, as far as they are near them."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.geometry.cutaway import cut_open
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import IndenterDisplacement, IndenterForce

SECTORS, ALONG = 96, 33
"""Sides of what is round, and points along its outline."""
PLATE = 0.1
"""Thickness of a plate, relative to the pad's longest side."""


def indenter_surface(pad: PadShape, magnify: float = 1.0) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices (V, 3) in mm and triangles (T, 3) of the body that presses on a live `deformable_pad`, if one does.

    Of a body larger than the pad, what lies further from its tip than the longest side of that is left out.

    Parameters
    ----------
    magnify : float
        What its displacement is multiplied by.
    """
    load, state = pad.load, pad.state
    if not isinstance(load, IndenterDisplacement | IndenterForce):
        return None
    assert state.indenter_moved is not None
    points = state.mesh.points
    vertices, triangles = _around_tip(load.indenter, float(np.ptp(points, axis=0).max()))
    start = load.indenter.start(points[load.indenter.highest(points)])
    vertices = vertices + start + magnify * state.indenter_moved
    return vertices @ pad.to_world[:3, :3].T + pad.to_world[:3, 3], triangles


def _around_tip(body: Indenter, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Of a body, what is within ``reach`` of its tip in each direction, which is at the origin."""
    vertices, triangles = _upright(body, reach)
    return vertices @ body.turn.T + [0.0, 0.0, body.lift], triangles


def _upright(body: Indenter, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`_around_tip`, of a body neither turned nor tilted."""
    if body.shape == "plane":
        return _prism(np.array([[-1, 0], [1, 0], [1, PLATE], [-1, PLATE]]) * reach, reach)
    if body.shape == "file":
        low = cut_open(body.solid.vertices, body.solid.triangles, np.array([0.0, 0.0, -1.0]), -reach)
        return low.vertices, low.triangles
    radius = body.radius or 0.0
    if body.shape == "punch":
        edge = min(body.edge, reach)
        turn = np.linspace(0, math.pi / 2, ALONG)
        rounded = np.stack([radius - edge + edge * np.sin(turn), edge - edge * np.cos(turn)], axis=1)
        return _revolved(np.minimum([[0, 0], *rounded, [radius, reach], [0, reach]], [reach, max(reach / 2, edge)]))
    if 2 * radius <= reach:
        furthest = math.pi
    else:
        furthest = math.acos(1 - reach / radius) if radius < reach else math.asin(reach / radius)
    turn = np.linspace(0, furthest, ALONG)
    outline = radius * np.stack([np.sin(turn), 1 - np.cos(turn)], axis=1)
    if body.shape == "sphere":
        return _revolved(np.append(outline, [[0, outline[-1, 1]]], axis=0))
    section = np.concatenate([outline[:0:-1] * [-1, 1], outline[: -1 if furthest == math.pi else None]])
    return _prism(section, reach)


def _revolved(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What an outline (n, 2), from axis to axis, makes as it turns about z."""
    import trimesh

    body = trimesh.creation.revolve(outline, sections=SECTORS)
    return np.asarray(body.vertices), np.asarray(body.faces)


def _prism(section: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    """A section (n, 2), counter-clockwise along y and z, drawn out along x by ``half`` to both sides."""
    ends = [np.insert(section, 0, end, axis=1) for end in (half, -half)]
    middles = [end.mean(axis=0, keepdims=True) for end in ends]
    count = len(section)
    here = np.arange(count)
    beside = np.roll(here, -1)
    front = np.stack([here, beside, np.full(count, 2 * count)], axis=1)
    back = np.stack([count + beside, count + here, np.full(count, 2 * count + 1)], axis=1)
    sides = [np.stack([here, count + here, count + beside], axis=1), np.stack([here, count + beside, beside], axis=1)]
    return np.concatenate([*ends, *middles]), np.concatenate([front, back, *sides])
