"""Emission guiding: directions of LED rays drawn so that more of them return by way of mirrors.

Light that a mirror reflects onto a small phototransistor is found by unidirectional hits alone, and most rays miss. A
pilot run learns from which part of the law's unit square light arrives; rays are then drawn from there more often, with
smaller weights. One ray in five is still drawn from the law alone, so that no weight exceeds five.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.kernels.paths.guide import guide_for
from mitsuba_taxel.kernels.paths.sample_warping import descend, shares_of_grid
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import has_mirrors

_DEPTH = 10  # levels of the tree: 32 x 32 cells
_PILOT = 1 << 14
_DEFENSIVE = 0.2
LARGEST_WEIGHT = 1 / _DEFENSIVE
"""Of a ray drawn from the learned density, relative to one drawn from the law."""


class GuidedEmission:
    """A piecewise constant density over the unit square for each taxel.

    Parameters
    ----------
    density : (T, 32, 32) ndarray
        Positive, row along the second coordinate; each mean is 1.
    """

    def __init__(self, density: np.ndarray) -> None:
        self.shares = mi.Float(in_packets(shares_of_grid(density)))
        self.density = mi.Float(in_packets(density))

    def sample(self, taxel: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point2f, mi.Float]:
        """A point of the unit square, and its density."""
        leaf, rest = descend(self.shares, mi.UInt32(_DEPTH), taxel, sample)
        x, y = mi.UInt32(0), mi.UInt32(0)
        for level in range(_DEPTH):  # bits of the two coordinates alternate
            bit = (leaf >> (_DEPTH - 1 - level)) & 1
            x, y = (2 * x + bit, y) if level % 2 == 0 else (x, 2 * y + bit)
        side = 1 << (_DEPTH // 2)
        density = dr.gather(mi.Float, self.density, (taxel * side + y) * side + x)
        return mi.Point2f(mi.Float(x) + rest.x, mi.Float(y) + rest.y) / side, density


def guided_emission(integrator: mi.Integrator, scene: mi.Scene, pair: TaxelPair) -> GuidedEmission | None:
    """The emission learned by a pilot run in a scene with mirrors; None without them.

    The pilot's random numbers are always the same and enter no result. The density is cached with the phototransistor:
    if the scene is changed, it is still valid, only less efficient.

    Parameters
    ----------
    integrator : mi.Integrator
        That traces the pilot run.
    scene : mi.Scene
        In which it does.
    pair : TaxelPair
        Whose LED emits.

    Returns
    -------
    GuidedEmission or None
        None without mirrors.
    """
    if not has_mirrors(scene):
        return None
    if pair.sensor.guided_emission is None:
        pair.sensor.guided_emission = GuidedEmission(_learn(integrator, scene, pair))
    learned: GuidedEmission = pair.sensor.guided_emission
    return learned


def _learn(integrator: mi.Integrator, scene: mi.Scene, pair: TaxelPair) -> np.ndarray:
    sampler = pair.sensor.sampler().fork()
    sampler.set_sample_count(_PILOT)
    lanes = pair.count * _PILOT
    sampler.seed(0, lanes)
    taxel = mi.UInt32(sampler.sequence)
    guide = guide_for(scene, pair)
    power = integrator.sample_guided(scene, pair, taxel, taxel, sampler, None, None, guide).numpy()
    sampler.seed(0, lanes)
    sampler.next_2d()
    u = np.array(sampler.next_2d())
    side = 1 << (_DEPTH // 2)
    column, row = np.minimum((u * side).astype(int), side - 1)
    cell = (np.arange(lanes) // _PILOT * side + row) * side + column
    square = np.bincount(cell, power.astype(float) ** 2, pair.count * side**2).reshape(-1, side, side)
    return _density(square)


def _density(square: np.ndarray) -> np.ndarray:
    """The density proportional to the root of summed squared powers in each cell, smoothed over neighbouring cells."""
    # The second coordinate is an angle for every law, so it wraps; the first does not.
    wrapped = np.pad(np.pad(square, ((0, 0), (1, 1), (0, 0)), mode="wrap"), ((0, 0), (0, 0), (1, 1)))
    near = sum(
        wrapped[:, i : i + square.shape[1], j : j + square.shape[2]] * (1.0 if i == j == 1 else 0.25)
        for i in range(3)
        for j in range(3)
    )
    wish = np.sqrt(near)
    mean = wish.mean(axis=(1, 2), keepdims=True)
    wish = np.divide(wish, mean, out=np.ones_like(wish), where=mean > 0)
    return _DEFENSIVE + (1 - _DEFENSIVE) * wish
