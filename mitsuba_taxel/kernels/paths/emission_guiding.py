"""Emission guiding: directions of LED rays sampled so that more rays return from mirrors.

Light that a mirror reflects onto a small phototransistor is only sampled by unidirectional hits, and most rays miss. A
pilot run learns which area of the unit square, which the emission law maps to directions, contributes light. Rays are
then sampled there more often, with smaller weights. One ray in five is still sampled from the law alone, so that no
weight exceeds five.

A small phototransistor is hit by few paths of a pilot run, which leave gaps at the border of that area. Rare rays with
a large weight would find the light of the gaps, and their scatter over few replicates understates the noise. Further
pilot runs are therefore guided by the density learned so far: they sample the border often, and close the gaps. If few
paths carry light, there are more pilot runs: the density is learned from some 1000 such paths per taxel.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.kernels.paths.guide import guide_for
from mitsuba_taxel.kernels.paths.plane_mirrors import plane_mirrors
from mitsuba_taxel.kernels.paths.sample_warping import descend, grid_splits
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import has_mirrors

_DEPTH = 10  # levels of the tree: 32 x 32 cells
_PILOT = 1 << 14  # paths of each pilot run per taxel
_PATHS_WITH_LIGHT = 1000  # that a taxel's density is learned from, counted by their effective number (Kish)
_FEWEST, _MOST = 3, 16  # pilot runs: the later ones are guided by the earlier ones
_DEFENSIVE = 0.2  # fraction of rays that are sampled from the law alone
LARGEST_WEIGHT = 1 / _DEFENSIVE
"""Largest weight of a ray that is sampled from the learned density, relative to a ray sampled from the law."""


class GuidedEmission:
    """A piecewise constant density over the unit square for each of T taxels. A point of the square is the pair of
    random numbers that the emission law maps to the direction of a ray.

    Parameters
    ----------
    density : (T, 32, 32) ndarray
        Positive, rows along the second coordinate; the mean of each taxel is 1.
    """

    def __init__(self, density: np.ndarray) -> None:
        self.splits = mi.Float(in_packets(grid_splits(density)))
        self.density = mi.Float(in_packets(density))

    def sample(self, taxel: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point2f, mi.Float]:
        """Sample a point of the unit square, which determines the direction of a ray, for the LED of a taxel; returns
        the point and its probability density.
        """
        leaf, rest = descend(self.splits, mi.UInt32(_DEPTH), taxel, sample)
        x, y = mi.UInt32(0), mi.UInt32(0)
        # The bits of a leaf's number alternate between the two coordinates.
        for level in range(_DEPTH):
            bit = (leaf >> (_DEPTH - 1 - level)) & 1
            x, y = (2 * x + bit, y) if level % 2 == 0 else (x, 2 * y + bit)
        side = 1 << (_DEPTH // 2)
        density = dr.gather(mi.Float, self.density, (taxel * side + y) * side + x)
        return mi.Point2f(mi.Float(x) + rest.x, mi.Float(y) + rest.y) / side, density


def guided_emission(integrator: mi.Integrator, scene: mi.Scene, pair: TaxelPair) -> GuidedEmission | None:
    """The emission density learned by a pilot run in a scene with mirrors.

    The random numbers of the pilot run are always the same and are not used for results. The density is cached with the
    phototransistor: after a change of the scene it is still valid, but less efficient.

    Parameters
    ----------
    integrator : mi.Integrator
        Integrator of the pilot run.
    scene : mi.Scene
        The scene.
    pair : TaxelPair
        LED and phototransistor.

    Returns
    -------
    GuidedEmission or None
        The density; None without mirrors.
    """
    if not has_mirrors(scene):
        return None
    if pair.sensor.guided_emission is None:
        pair.sensor.guided_emission = GuidedEmission(_learn(integrator, scene, pair))
    learned: GuidedEmission = pair.sensor.guided_emission
    return learned


def _learn(integrator: mi.Integrator, scene: mi.Scene, pair: TaxelPair) -> np.ndarray:
    """Learn the density (T, 32, 32) by pilot runs. Each run samples the density that the earlier runs have learned."""
    sampler = pair.sensor.sampler().fork()
    sampler.set_sample_count(_PILOT)
    lanes, side = pair.count * _PILOT, 1 << (_DEPTH // 2)
    guide, mirrors = guide_for(scene, pair), plane_mirrors(scene, pair)
    emission: GuidedEmission | None = None
    square, fourth = np.zeros((pair.count, side, side)), np.zeros(pair.count)
    for run in range(_MOST):
        # Power of each path.
        sampler.seed(run, lanes)
        taxel = mi.UInt32(sampler.sequence)
        power = integrator.sample_guided(scene, pair, taxel, taxel, sampler, None, emission, guide, mirrors).numpy()

        # The second pair of random numbers of each path again, which the law maps to its direction.
        sampler.seed(run, lanes)
        sampler.next_2d()
        sample, density = sampler.next_2d(), mi.Float(1)
        if emission is not None:
            sample, density = emission.sample(taxel, sample)
        column, row = np.minimum((np.array(sample) * side).astype(int), side - 1)
        cell = (np.arange(lanes) // _PILOT * side + row) * side + column
        # For rays sampled with a density, the mean of power^2 times density estimates the mean of power^2 for rays of
        # the law alone.
        squares = power.astype(float) ** 2 * np.broadcast_to(density.numpy(), lanes)
        square += np.bincount(cell, squares, pair.count * side**2).reshape(-1, side, side)
        fourth += np.sum(squares.reshape(pair.count, -1) ** 2, axis=1)
        learned = _density(square)
        emission = GuidedEmission(learned)
        lit = fourth > 0
        paths = square[lit].sum(axis=(1, 2)) ** 2 / fourth[lit]  # effective number
        if run + 1 >= _FEWEST and np.all(paths >= _PATHS_WITH_LIGHT):
            break
    return learned


def _density(square: np.ndarray) -> np.ndarray:
    """Density proportional to the root of the sum of squared powers in each cell, smoothed over neighbouring cells."""
    # The second coordinate is an angle for every law, so it is periodic; the first is not.
    wrapped = np.pad(np.pad(square, ((0, 0), (1, 1), (0, 0)), mode="wrap"), ((0, 0), (0, 0), (1, 1)))
    smoothed = sum(
        wrapped[:, i : i + square.shape[1], j : j + square.shape[2]] * (1.0 if i == j == 1 else 0.25)
        for i in range(3)
        for j in range(3)
    )
    target = np.sqrt(smoothed)
    mean = target.mean(axis=(1, 2), keepdims=True)
    target = np.divide(target, mean, out=np.ones_like(target), where=mean > 0)
    return _DEFENSIVE + (1 - _DEFENSIVE) * target
