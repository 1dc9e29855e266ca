"""What ever thinner layers of a mould do to the light, as the tutorial on rough moulds says: not the program's code.

Rays meet the smooth cap of a spherical cell. At each meeting they are followed through infinitely small treads and
risers that lie along the slope there, until they leave it. Whatever is not roof absorbs.
"""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import LayerSteps, Pad, PadSensor, measure

PAD = Pad("spherical", rows=1, columns=1)
CENTRE = np.array([0, 0, PAD.top_of_cell - PAD.shape.roof_radius])
LED, PHOTOTRANSISTOR = (-0.45, 0.0, 0.5), (0.45, 0.0, 0.5)
LED_SIDE, LED_HOLE, CONE = 0.25, 0.1, np.radians(88)
SIDES = np.array([0.52, 0.30])
LEFT, TREAD, RISER = range(3)
NORMALS = np.array([[0, 0, 0], [0, 0, -1], [1, 0, 0]])  # towards the axis, round it, upwards


def released(rng, count):
    """Places on the LED and directions of a beam of even density."""
    across = rng.uniform(-LED_SIDE / 2, LED_SIDE / 2, (2 * count, 2))
    across = across[np.abs(across).max(axis=1) > LED_HOLE / 2][:count]
    height, turn = rng.uniform(np.cos(CONE), 1, count), rng.uniform(0, 2 * np.pi, count)
    level = np.sqrt(1 - height**2)
    return np.insert(across, 2, 0, axis=1) + LED, np.stack([level * np.cos(turn), level * np.sin(turn), height], axis=1)


def scattered(rng, normals):
    """Isotropic directions: evenly over the half-space of each normal."""
    direction = rng.normal(size=normals.shape)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    return direction * np.sign(np.sum(direction * normals, axis=1))[:, None]


def met(origin, direction):
    """Where rays meet the cap, and whether they do."""
    from_centre = origin - CENTRE
    along = np.sum(from_centre * direction, axis=1)
    root = along**2 - np.sum(from_centre**2, axis=1) + PAD.shape.roof_radius**2
    place = origin + (np.sqrt(np.maximum(root, 0)) - along)[:, None] * direction
    return place, (root > 0) & (place[:, 2] > PAD.side_height)


def followed(u, z, column, rise, direction):
    """Follow rays in stairs, whose tread over columns k < u < k + 1 has the height k * rise, to tread, riser or out."""
    u, z, column, found = u.copy(), z.copy(), column.copy(), np.full(len(u), LEFT)
    du, dz = direction[:, 0], direction[:, 2]
    away, left = du * rise > dz, np.arange(len(u))
    while len(left):
        i = left[~(away[left] & (z[left] <= (u[left] - 1) * rise[left] + 1e-12))]  # those below all edges are out
        with np.errstate(divide="ignore", invalid="ignore"):
            up = np.where(dz[i] > 0, (column[i] * rise[i] - z[i]) / dz[i], np.inf).clip(0)
            aside = ((column[i] + (du[i] > 0) - u[i]) / du[i]).clip(0)
        above = up <= aside
        found[i[above]] = TREAD
        u[i[above]] += up[above] * du[i[above]]
        z[i[above]] = (column * rise)[i[above]]
        i, aside = i[~above], aside[~above]
        z[i] += aside * dz[i]
        u[i] = column[i] + (du[i] > 0)
        stopped = (du[i] < 0) & (z[i] > (column[i] - 1) * rise[i])
        found[i[stopped]] = RISER
        left = i[~stopped]
        column[left] += np.sign(du[left]).astype(int)
    return found, u, z, column


def smooth_wall(rng, place, direction, seen):
    """How often each ray is scattered in sight of a direction, and where it leaves to."""
    normal = (CENTRE - place) / PAD.shape.roof_radius
    return (np.sum(seen * normal, axis=1) > 0).astype(float), scattered(rng, normal)


def stairs(rng, place, direction, seen):
    """The same for stairs along the slope at each place."""
    radius = np.hypot(place[:, 0], place[:, 1])
    inward = np.stack([-place[:, 0], -place[:, 1], 0 * radius], axis=1) / radius[:, None]
    frame = np.stack([inward, np.cross([0, 0, 1], inward), np.tile([0, 0, 1], (len(place), 1))], axis=1)
    here, towards = (np.einsum("nij,nj->ni", frame, vectors) for vectors in (direction, seen))
    rise = radius / np.sqrt(PAD.shape.roof_radius**2 - radius**2)
    u = rng.uniform(size=len(place))
    kind, u, z, column = followed(u, (u - 1) * rise, np.zeros(len(u), dtype=int), rise, here)
    times = np.zeros(len(u))
    while len(i := np.flatnonzero(kind != LEFT)):
        normals = NORMALS[kind[i]]
        state = (u[i], z[i], column[i], rise[i])
        times[i] += (np.sum(towards[i] * normals, axis=1) > 0) & (followed(*state, towards[i])[0] == LEFT)
        here[i] = scattered(rng, normals)
        kind[i], u[i], z[i], column[i] = followed(*state, here[i])
    return times, np.einsum("nij,ni->nj", frame, here)


def reading(wall, rays, seed=1):
    """Power on the phototransistor in W, and its standard error."""
    rng = np.random.default_rng(seed)
    place, direction = released(rng, rays)
    number, power = np.arange(rays), np.zeros(rays)
    while True:
        place, hit = met(place, direction)
        place, direction, number = place[hit], direction[hit], number[hit]
        if not len(place):
            return power.mean(), power.std() / np.sqrt(rays)
        target = np.insert((rng.uniform(size=(len(place), 2)) - 0.5) * SIDES, 2, 0, axis=1) + PHOTOTRANSISTOR
        distance = np.linalg.norm(target - place, axis=1)
        seen = (target - place) / distance[:, None]
        times, direction = wall(rng, place, direction, seen)
        np.add.at(power, number, times * SIDES.prod() * -seen[:, 2] / distance**2 / (2 * np.pi))
        place = place + 1e-9 * direction


@pytest.mark.parametrize("wall, finish, rays", [(smooth_wall, None, 400_000), (stairs, LayerSteps(0.02), 200_000)])
def test_the_program_agrees(wall, finish, rays):
    """False alarms of 4 standard errors: 6e-5; layers of 0.02 mm are thin beside a cap of 0.34 mm."""
    expected, error = reading(wall, rays)
    found = measure(PadSensor(PAD, finish=finish).scene(), points=1024, seed=2)
    assert abs(found.power[0] - expected) < 4 * np.hypot(found.standard_error[0], error)


def test_thin_layers_send_more_light_back_than_a_smooth_cap():
    (plain, error), (thin, other) = reading(smooth_wall, 400_000), reading(stairs, 200_000)
    assert abs(thin / plain - 1.27) < 4 * np.hypot(error / plain, other / thin) * thin / plain
