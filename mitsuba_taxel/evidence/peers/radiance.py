"""Readings by Radiance (`pyradiance`): `rtrace -I` at points of the phototransistor, with one ambient bounce at the
plate."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mitsuba_taxel.evidence.peers.cases import DETECTOR, LED_SIDE, Estimator, PeerCase

POINTS = 32
"""Detector points along x and along y; the rest of the samples are the directions traced from each."""
ACCURACY = "-aa 0 -as 0 -lw 0 -lr 8 -ds 0.1 -dj 1 -dt 0 -dc 1 -dr 0 -st 0"
"""No interpolation of ambient light, no cut-offs; the LED is divided and sampled with full jitter."""


def prepare(case: PeerCase) -> Estimator:
    """Return a function that estimates readings from the irradiance at jittered points of the phototransistor, in a
    scene that contains only LED and plate."""
    z, spacing = case.plate()
    import pyradiance

    folder = tempfile.TemporaryDirectory()
    octree = pyradiance.oconv(stdin=_scene(z, spacing).encode(), warning=False)
    Path(folder.name, "scene.oct").write_bytes(octree)

    def estimate(samples: int, seed: int) -> np.ndarray:
        directions = max(1, samples // POINTS**2)
        out = pyradiance.rtrace(
            _detector_points(spacing, seed).astype("<f4").tobytes(),
            Path(folder.name, "scene.oct"),
            header=False,
            inform="f",
            outform="f",
            irradiance=True,
            uncorrelated=True,
            nproc=os.cpu_count(),
            params=f"-ab 1 -ad {directions} {ACCURACY}".split(),
        )
        irradiance = np.frombuffer(out, dtype="<f4").reshape(-1, 3)[:, 0]
        return np.array([irradiance.mean(dtype=float) * DETECTOR[0] * DETECTOR[1]])

    return estimate


def _scene(z: float, spacing: float) -> str:
    """LED and plate as Radiance's scene text. The corners of a polygon are listed counter-clockwise as seen from its
    front."""
    radiance = 1 / (math.pi * LED_SIDE**2)
    x0, x1, half = -0.5 * spacing - 0.5 * LED_SIDE, -0.5 * spacing + 0.5 * LED_SIDE, 0.5 * LED_SIDE
    led = [(x0, -half, 0), (x1, -half, 0), (x1, half, 0), (x0, half, 0)]
    plate = [(-2, -2, z), (-2, 2, z), (2, 2, z), (2, -2, z)]
    glow, white = f"void light glow\n0\n0\n3 {3 * f'{radiance} '}\n", "void plastic white\n0\n0\n5 1 1 1 0 0\n"
    return glow + white + _polygon("glow", "led", led) + _polygon("white", "plate", plate)


def _polygon(material: str, name: str, corners: Sequence[Sequence[float]]) -> str:
    numbers = " ".join(f"{value:.9g}" for corner in corners for value in corner)
    return f"{material} polygon {name}\n0\n0\n{3 * len(corners)} {numbers}\n"


def _detector_points(spacing: float, seed: int) -> np.ndarray:
    """Points (POINTS², 6) of the phototransistor in random order: position and upward normal of one random point in
    each cell of a grid."""
    rng = np.random.default_rng(seed)
    cell = np.stack(np.meshgrid(np.arange(POINTS), np.arange(POINTS)), axis=-1).reshape(-1, 2)
    offset = ((cell + rng.random(cell.shape)) / POINTS - 0.5) * DETECTOR
    rng.shuffle(offset)
    rays = np.zeros((POINTS**2, 6))
    rays[:, :2] = offset + (0.5 * spacing, 0)
    rays[:, 5] = 1
    return rays
