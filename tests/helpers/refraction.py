"""Light from the die of an emitter by way of a Lambertian plate to that of a detector, by refraction ray by ray.

It shares no code with the program. Rays start on the emitter's die, evenly over it and Lambertian in the resin, and are
bent at its window by Snell's law and weakened by Fresnel's; from where they meet the plate, rays go to points of the
detector's window, and what enters there counts if it meets the die. Lengths are in mm.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

RAYS, RANDOMISATIONS = 2**15, 16


def plate_power(part, height, *, half=4.0, centre=(0.0, 0.0), apart=(0.0, 0.0), seed=0):
    """Power on the detector per W that the emitter sends into the resin, by way of a square plate of reflectance 1, and
    its standard error; ``apart`` is by how much another package's detector is shifted."""
    return _mean(_by_way_of_plate, part, height, half, np.array(centre), np.array(apart), seed=seed)


def escaping(side, index):
    """Share of the light of a die that leaves its window, and its standard error."""
    return _mean(lambda u: _rays_from(side, index, u)[2].mean())


def _mean(estimate, *arguments, seed=0):
    rows = (qmc.Sobol(6, seed=np.random.default_rng((seed, n))).random(RAYS) for n in range(RANDOMISATIONS))
    values = [estimate(*arguments, u) for u in rows]
    return np.mean(values), np.std(values, ddof=1) / np.sqrt(RANDOMISATIONS)


def _by_way_of_plate(part, height, half, centre, apart, u):
    place, step, share = _rays_from(part.emitter, part.resin_index, u)
    lit = place + height * step
    on_plate = np.all(np.abs(lit - centre) < half, axis=1)
    detector, index = part.detector, part.resin_index
    # Beyond the critical angle no light comes from the die.
    beside = detector.die_depth / np.sqrt(index**2 - 1) if index > 1 else np.inf
    die = np.array([[detector.x, detector.y], [detector.die_width, detector.die_length]])
    window = np.array([detector.window_centre, (detector.window_width, detector.window_length)])
    low = np.maximum(window[0] - window[1] / 2, die[0] - die[1] / 2 - beside)
    high = np.minimum(window[0] + window[1] / 2, die[0] + die[1] / 2 + beside)
    entry = low + u[:, 4:] * (high - low)
    way = entry + apart - lit
    across = np.linalg.norm(way, axis=1)
    outside = np.arctan2(across, height)
    within = np.arcsin(np.sin(outside) / index)
    end = entry + (detector.die_depth * np.tan(within) / across)[:, None] * way
    met = np.all(np.abs(end - die[0]) < die[1] / 2, axis=1) & _in_window(detector, entry)
    caught = np.cos(outside) ** 4 / (np.pi * height**2) * np.prod(high - low) * _transmittance(within, outside, index)
    return (share * on_plate * met * caught).mean()


def _rays_from(side, index, u):
    """Where rays leave the window (N, 2), their lateral step per height in air (N, 2), and the share that leaves."""
    start = (u[:, :2] - 0.5) * (side.die_width, side.die_length) + (side.x, side.y)
    turn, within = 2 * np.pi * u[:, 2], np.arcsin(np.sqrt(u[:, 3]))
    free = index * np.sin(within) < 1  # the others are reflected at the window
    outside = np.arcsin(np.minimum(index * np.sin(within), 1 - 1e-12))
    heading = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    place = start + side.die_depth * np.tan(within)[:, None] * heading
    share = _transmittance(within, outside, index) * free * _in_window(side, place)
    return place, np.tan(outside)[:, None] * heading, share


def _transmittance(within, outside, index):
    inner, outer = np.cos(within), np.cos(outside)
    across, along = (index * inner - outer) / (index * inner + outer), (inner - index * outer) / (inner + index * outer)
    return 1 - (across**2 + along**2) / 2


def _in_window(side, places):
    x, y = np.abs(places - side.window_centre).T
    radius = side.window_width / 2
    straight = side.window_length / 2 - (radius if side.window_shape == "obround" else 0.0)
    round_end = (x**2 + (y - straight) ** 2 < radius**2) & (side.window_shape == "obround")
    return ((x < radius) & (y < straight)) | round_end
