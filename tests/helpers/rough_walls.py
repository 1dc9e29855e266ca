"""A tracer of rough roofs that uses neither triangles nor the program's code: the reading of one photo-reflector.

The LED's light is uniform per solid angle within a cone. The roof scatters isotropically (as much per solid angle in
all directions), and everything else is black. Roofs are exact: a staircase of discs, V-shaped grooves, or Gaussian
heights. A homogeneous deformation (stretch across, stretch along z) maps each of them onto a roof of the same kind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

PLANE = 0.5  # of LED and phototransistor, mm
LED, PHOTOTRANSISTOR = np.array([-0.45, 0, PLANE]), np.array([0.45, 0, PLANE])
LED_SIDE, LED_HOLE, CONE = 0.25, 0.1, np.radians(88)
SIDES = np.array([0.52, 0.30])


@dataclass
class Staircase:
    """Discs of radii ``radius`` (J,) between ``levels`` (J,) and the next ones: the lowest disc is the black shaft, the
    last one has no radius."""

    radius: np.ndarray
    levels: np.ndarray

    @classmethod
    def of_dome(cls, shaft, side_height, sphere, centre, layer, offset=0.0, across=1.0, along=1.0):
        """Discs with the cross-section at the middle of each layer of a shaft with a spherical roof."""
        first = np.floor((side_height - offset) / layer + 0.5)  # of the level nearest to the edge of the roof
        levels = offset + layer * (first + np.arange(1000))
        rise = levels + 0.5 * layer - centre
        inside = rise < sphere
        radius = np.sqrt(np.maximum(sphere**2 - rise**2, 0))[inside]
        levels = np.concatenate([[-np.inf], levels[: inside.sum() + 1]])
        return cls(across * np.concatenate([[shaft], np.minimum(radius, shaft), [0.0]]), along * levels)

    def hit(self, origin, direction, start):
        """Where rays from discs ``start`` end on the roof: positions, normals, discs, and whether they do."""
        position, disc = origin.copy(), start.copy()
        normal, found = np.zeros_like(origin), np.zeros(len(origin), dtype=bool)
        upper = np.append(self.levels[1:], np.inf)
        active = np.arange(len(origin))
        while len(active):
            p, d, j = position[active], direction[active], disc[active]
            level = (d[:, :2] ** 2).sum(axis=1)
            along = (p[:, :2] * d[:, :2]).sum(axis=1)
            root = along**2 + level * (self.radius[j] ** 2 - (p[:, :2] ** 2).sum(axis=1))
            with np.errstate(divide="ignore", invalid="ignore"):
                to_wall = np.where(level > 0, (np.sqrt(np.maximum(root, 0)) - along) / level, np.inf)
                plane = np.where(d[:, 2] > 0, upper[j], np.where(j > 0, self.levels[j], PLANE))
                to_plane = np.maximum((plane - p[:, 2]) / d[:, 2], 0)
            on_wall = to_wall <= to_plane
            p = p + np.minimum(to_wall, to_plane)[:, None] * d
            p[~on_wall, 2] = plane[~on_wall]
            position[active] = p
            up = ~on_wall & (d[:, 2] > 0)
            tread = up & (np.hypot(p[:, 0], p[:, 1]) >= self.radius[np.minimum(j + 1, len(self.radius) - 1)])
            riser = on_wall & (j > 0)
            inwards = np.insert(-p[:, :2], 2, 0.0, axis=1) / np.maximum(np.hypot(p[:, 0], p[:, 1]), 1e-12)[:, None]
            normal[active] = np.where(riser[:, None], inwards, [0.0, 0.0, -1.0])
            found[active] = tread | riser
            down = ~on_wall & (d[:, 2] <= 0)
            disc[active] = j + (up & ~tread) - (down & (j > 0))
            active = active[~(tread | on_wall | (down & (j == 0)))]
        return position, normal, disc, found

    def below(self, count):
        """State of ``count`` rays that start below the roof."""
        return np.zeros(count, dtype=int)


@dataclass
class Grooves:
    """A flat roof of a square cell with V-shaped grooves across a horizontal direction."""

    half_width: float
    height: float
    pitch: float
    depth: float
    direction: tuple[float, float]

    def hit(self, origin, direction, start):
        del start
        half, rise = 0.5 * self.pitch, 2 * self.depth / self.pitch
        axis = np.array(self.direction) / np.hypot(*self.direction)
        lowest = self.height - 0.5 * self.depth
        position, normal = origin.copy(), np.zeros_like(origin)
        found = np.zeros(len(origin), dtype=bool)
        # Rays from below start at the ridges.
        rising = (position[:, 2] < lowest) & (direction[:, 2] > 1e-12)
        distance = (lowest - position[rising, 2]) / direction[rising, 2]
        position[rising] += distance[:, None] * direction[rising]
        u, du = position[:, :2] @ axis, direction[:, :2] @ axis
        z, dz = position[:, 2].copy(), direction[:, 2]
        column = np.floor(u / half).astype(int)
        travelled = np.zeros(len(origin))
        active = np.flatnonzero((z > lowest - 1e-12) & ((dz > 0) | (z > lowest)))
        while len(active):
            c = column[active]
            slope = np.where(c % 2 == 0, rise, -rise)
            flank = np.where(c % 2 == 0, lowest, lowest + self.depth)
            here, there = u[active], du[active]
            gap = flank + slope * (here - c * half) - z[active]
            closing = dz[active] - slope * there
            with np.errstate(divide="ignore", invalid="ignore"):
                to_flank = np.where((closing > 0) & (gap > 1e-10), gap / closing, np.inf)
                to_edge = np.where(there != 0, ((c + (there > 0)) * half - here) / there, np.inf).clip(0)
                to_ridge = np.where(dz[active] < 0, (lowest - z[active]) / dz[active], np.inf).clip(0)
            on_flank = to_flank <= np.minimum(to_edge, to_ridge)
            out = ~on_flank & (to_ridge <= to_edge)
            step = np.minimum(np.minimum(to_flank, to_edge), to_ridge)
            travelled[active] += step
            u[active] += step * there
            z[active] += step * dz[active]
            edge = ~on_flank & ~out
            column[active[edge]] += np.sign(there[edge]).astype(int)
            found[active[on_flank]] = True
            length = np.hypot(1, rise)
            normal[active, :2] = (slope / length)[:, None] * axis
            normal[active, 2] = -1 / length
            too_far = travelled[active] > 10
            active = active[edge & ~too_far]
        position += travelled[:, None] * direction
        found &= np.abs(position[:, :2]).max(axis=1) < self.half_width  # else the black side comes first
        return position, normal, np.zeros(len(origin), dtype=int), found

    def below(self, count):
        return np.zeros(count, dtype=int)


@dataclass
class Heights:
    """A flat roof of a square cell whose height above z = 0 is a smooth function, known on a grid."""

    half_width: float
    height: float
    largest: float
    length: float
    spline: RectBivariateSpline

    @classmethod
    def of_finish(cls, finish, half_width, height, across=1.0, along=1.0):
        """The roof with the heights of a `RandomRoughness`, which protrude from the silicone, hence downwards."""
        count = int(16 * 2.4 * half_width / finish.correlation_length)
        x = np.linspace(-1.2 * half_width, 1.2 * half_width, count)
        grid = np.stack([*np.meshgrid(x, x, indexing="ij"), np.full((count, count), height)], axis=-1)
        heights = finish.heights(grid.reshape(-1, 3)).reshape(count, count)
        spline = RectBivariateSpline(across * x, across * x, along * (height - heights))
        largest = along * np.abs(heights).max()
        return cls(across * half_width, along * height, largest, across * finish.correlation_length, spline)

    def above(self, position):
        return position[:, 2] - self.spline.ev(position[:, 0], position[:, 1])

    def hit(self, origin, direction, start):
        del start
        position, found = origin.copy(), np.zeros(len(origin), dtype=bool)
        low, high = self.height - self.largest, self.height + self.largest
        rising = (position[:, 2] < low) & (direction[:, 2] > 1e-12)
        distance = (low - position[rising, 2]) / direction[rising, 2]
        position[rising] += distance[:, None] * direction[rising]
        step = self.length / 12
        active = np.flatnonzero(position[:, 2] > low - 1e-9)
        position[active] += 1e-7 * direction[active]
        while len(active):
            here = position[active]
            there = here + step * direction[active]
            crossed = self.above(there) > 0
            # Bisection of the steps that cross the roof.
            a, b = np.zeros(crossed.sum()), np.full(crossed.sum(), step)
            start_of, along = here[crossed], direction[active[crossed]]
            for _ in range(30):
                middle = 0.5 * (a + b)
                is_above = self.above(start_of + middle[:, None] * along) > 0
                a, b = np.where(is_above, a, middle), np.where(is_above, middle, b)
            position[active] = there
            position[active[crossed]] = start_of + a[:, None] * along
            found[active[crossed]] = True
            outside = np.abs(there[:, :2]).max(axis=1) > 1.1 * self.half_width
            gone = crossed | outside | ((there[:, 2] < low) & (direction[active, 2] < 0)) | (there[:, 2] > high + 1)
            active = active[~gone]
        x, y = position[:, 0], position[:, 1]
        slope = np.stack([self.spline.ev(x, y, dx=1), self.spline.ev(x, y, dy=1)], axis=1)
        normal = np.concatenate([slope, np.full((len(x), 1), -1.0)], axis=1)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        found &= np.abs(position[:, :2]).max(axis=1) < self.half_width
        return position, normal, np.zeros(len(origin), dtype=int), found

    def below(self, count):
        return np.zeros(count, dtype=int)


def readings(roof, reflectance, rays, seed=1, bounces=30):
    """(rays,) W, power on the phototransistor for 1 W from the LED, of each ray."""
    rng = np.random.default_rng(seed)
    across = rng.uniform(-LED_SIDE / 2, LED_SIDE / 2, (2 * rays, 2))
    across = across[np.abs(across).max(axis=1) > LED_HOLE / 2][:rays]
    cosine, turn = rng.uniform(np.cos(CONE), 1, rays), rng.uniform(0, 2 * np.pi, rays)
    level = np.sqrt(1 - cosine**2)
    position = LED + np.insert(across, 2, 0, axis=1)
    direction = np.stack([level * np.cos(turn), level * np.sin(turn), cosine], axis=1)
    state, number, weight = roof.below(rays), np.arange(rays), 1.0
    power = np.zeros(rays)
    for _ in range(bounces):
        # All random numbers of a bounce are drawn for all rays: two roofs that differ little share them.
        numbers = rng.uniform(size=(rays, 4))[number]
        position, normal, state, found = roof.hit(position, direction, state)
        position, normal, state, number, numbers = (x[found] for x in (position, normal, state, number, numbers))
        weight *= reflectance
        if not len(number):
            break
        # Light to a point on the phototransistor, if nothing is between.
        target = PHOTOTRANSISTOR + np.insert((numbers[:, :2] - 0.5) * SIDES, 2, 0, axis=1)
        seen = target - position
        distance = np.linalg.norm(seen, axis=1)
        seen /= distance[:, None]
        facing = (seen * normal).sum(axis=1)
        visible = facing > 0
        lit = np.flatnonzero(visible)
        visible[lit] = ~roof.hit(position[lit], seen[lit], state[lit])[3]
        geometry = -seen[:, 2] / distance**2
        np.add.at(power, number, weight * visible * geometry * SIDES.prod() / (2 * np.pi))
        # A direction in the half-space of the normal.
        up = np.where(np.abs(normal[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
        first = np.cross(up, normal)
        first /= np.linalg.norm(first, axis=1)[:, None]
        second = np.cross(normal, first)
        radius, angle = np.sqrt(1 - numbers[:, 2] ** 2), 2 * np.pi * numbers[:, 3]
        direction = (
            (radius * np.cos(angle))[:, None] * first
            + (radius * np.sin(angle))[:, None] * second
            + numbers[:, 2, None] * normal
        )
    return power
