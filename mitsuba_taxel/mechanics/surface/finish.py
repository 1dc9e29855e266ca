"""Surface finishes of the walls of cells, from a printed mould: layer steps, grooves, or random roughness."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.surfaces.slices import sliced
from mitsuba_taxel.mechanics.surface.layers import is_vertical, stepped
from mitsuba_taxel.mechanics.surface.relief import Relief, SmoothSurface
from mitsuba_taxel.parameters import REQUIRED, Checked, number, vector, whole

RANDOM_WAVES = 256
"""Number of plane waves of random roughness."""
LEAST_EDGES = 2
"""Triangle edges per correlation length below which triangles do not resolve random heights. At 2, readings of a dome
differ by 0.3 % +- 0.15 % from those at 12, with an rms slope of 0.28; at the default, 4, by 0.14 % +- 0.12 %."""
BLUNTING = 1 / (8 * FACETS_SHARE)
"""Fraction of the distance by which `BluntHeights` move each vertex to the mean of its neighbours. Triangles of edges h
lose the fraction h^2 / (2 correlation_length^2) of the mean square slope; on equilateral triangles, the mean differs
from a height by h^2 / 4 times its Laplacian, and a full move to the mean loses 8 times as much."""
STANDARD_DEVIATIONS = 4
"""Assumed largest height of random roughness, relative to its standard deviation."""


def _refinement(default: float) -> float:
    doc = (
        "Minimum number of triangle edges per layer height, groove pitch or correlation length; `subdivision` is "
        "raised accordingly. Random heights need 2 or more."
    )
    return number(default, "", doc, above=0, name="finish_refinement")


class Finish(Hashable, Protocol):
    """Base class of surface finishes: the microscopic shape of the walls of cells that a mould leaves, such as layer
    steps.
    """

    cuts: ClassVar[int]
    """Number of planes per :attr:`detail` that cut the surface."""

    @property
    def refinement(self) -> float:
        """Minimum number of triangle edges per :attr:`detail`."""

    @property
    def detail(self) -> tuple[str, float]:
        """Name and value in mm of the smallest length of the finish. The triangles of the surface must be small enough
        to show it.
        """

    @property
    def amplitude(self) -> tuple[str, float, float]:
        """Name and value of the parameter to which the displacement of walls is proportional, and its largest value in
        mm."""

    def relief(self, smooth: SmoothSurface) -> Relief:
        """The rough surface, as offsets from the ``smooth`` surface, on the walls that have this finish."""


@dataclass(frozen=True)
class LayerSteps(Checked):
    """A finish of steps, from a mould printed in layers.

    Layer k extends from k to k + 1 times the layer height along the direction, counted from the offset, and has the
    cell's cross-section at the middle of the layer. A tread thus lies at the level nearest to the smooth wall
    (half-way, at the higher level). Walls along the direction do not change; a flat roof across it moves to the nearest
    level.
    """

    layer_height: float = number(REQUIRED, "mm", "Height of a printed layer.", above=0, common=(0.002, 5))
    direction: Sequence[float] = vector(
        (0.0, 0.0, 1.0),
        "",
        "Direction in which the mould was printed, of any length.",
        is_direction=True,
        name="print_direction",
    )
    refinement: float = _refinement(1.0)
    offset: float = number(
        0.0,
        "mm",
        "Start of the first layer, along the print direction from the centre of the cells' mouths (z = 0 and the "
        "pad's centre); at most one layer height in either direction.",
        name="layer_offset",
    )

    cuts: ClassVar[int] = 1

    def _check(self) -> None:
        if abs(self.offset) > self.layer_height:
            raise InputError(
                f"layer_offset = {self.offset:g} is not allowed: a number from {-self.layer_height:g} to "
                f"{self.layer_height:g} mm, one layer_height, is needed."
            )

    @property
    def detail(self) -> tuple[str, float]:
        return "layer_height", self.layer_height

    @property
    def amplitude(self) -> tuple[str, float, float]:
        return "layer_height", self.layer_height, 0.5 * self.layer_height

    @property
    def is_vertical(self) -> bool:
        """Whether the mould is printed along the vertical, so that its layers are horizontal."""
        return is_vertical(_unit(self.direction))

    def relief(self, smooth: SmoothSurface) -> Relief:
        return stepped(smooth, self.layer_height, self.offset, _unit(self.direction))


@dataclass(frozen=True)
class Grooves(Checked):
    """A finish of V-shaped grooves, half above and half below the smooth wall.

    Ridges protrude from the silicone by half the depth. They lie where the distance from the centre of the pad's
    bottom, along the direction, is a multiple of the pitch; valleys lie midway. A wall across the direction has no
    grooves; it moves to the height of the groove at its position.
    """

    pitch: float = number(
        REQUIRED, "mm", "Distance between ridges along the direction.", above=0, common=(0.002, 10), name="groove_pitch"
    )
    depth: float = number(
        REQUIRED, "mm", "Height from valley to ridge along the normal of the smooth wall.", above=0, name="groove_depth"
    )
    direction: Sequence[float] = vector(
        (1.0, 0.0, 0.0), "", "Direction across the grooves, of any length.", is_direction=True, name="groove_direction"
    )
    refinement: float = _refinement(1.0)

    cuts: ClassVar[int] = 2

    @property
    def detail(self) -> tuple[str, float]:
        return "groove_pitch", self.pitch

    @property
    def amplitude(self) -> tuple[str, float, float]:
        return "groove_depth", self.depth, 0.5 * self.depth

    def relief(self, smooth: SmoothSurface) -> Relief:
        """The grooved surface, cut along ridges and valleys, so that each flank on a flat wall is plane."""
        phase = smooth.vertices @ _unit(self.direction) / (0.5 * self.pitch)
        pieces = sliced(phase, smooth.triangles, smooth.rough)
        height = 0.5 * self.depth * (1 - 2 * np.abs((pieces.height + 1) % 2 - 1))
        unit = smooth.unit_offset
        unit = unit[pieces.low] + pieces.fraction[:, None] * (unit[pieces.high] - unit[pieces.low])
        return Relief(
            pieces.low, pieces.high, pieces.fraction, height[:, None] * unit, pieces.triangles, pieces.parents
        )


@dataclass(frozen=True)
class RandomRoughness(Checked):
    """A random finish: Gaussian heights along the normal of the smooth wall with the correlation exp(-r^2 /
    correlation_length^2).

    The heights of different cells differ.
    """

    rms_height: float = number(REQUIRED, "mm", "Standard deviation of the heights.", above=0)
    correlation_length: float = number(
        REQUIRED, "mm", "Distance at which the correlation of heights has fallen to 1/e.", above=0, common=(0.0005, 10)
    )
    seed: int = whole(0, 0, 2**31 - 1, "Seed of the sample of the roughness.", name="roughness_seed")
    refinement: float = _refinement(4.0)

    cuts: ClassVar[int] = 0

    def _check(self) -> None:
        if self.refinement < LEAST_EDGES:
            raise InputError(
                f"finish_refinement = {self.refinement:g} is not allowed: random heights need at least {LEAST_EDGES:g} "
                "triangle edges per correlation_length, and this parameter is that number; a larger finish_refinement "
                "is needed."
            )

    @property
    def detail(self) -> tuple[str, float]:
        return "correlation_length", self.correlation_length

    @property
    def amplitude(self) -> tuple[str, float, float]:
        return "rms_height", self.rms_height, STANDARD_DEVIATIONS * self.rms_height

    def relief(self, smooth: SmoothSurface) -> Relief:
        on_walls = np.unique(smooth.triangles[smooth.rough])
        offset = np.zeros_like(smooth.vertices)
        offset[on_walls] = self.heights(smooth.vertices[on_walls])[:, None] * smooth.unit_offset[on_walls]
        return Relief.of_vertices(smooth, offset)

    @property
    def blunt(self) -> BluntHeights:
        """The same random heights with smaller slopes. The change that they cause in the readings is the estimate of
        the error due to flat triangles.
        """
        return BluntHeights(self.rms_height, self.correlation_length, self.seed, self.refinement)

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Heights of the rough surface.

        A sum of plane waves whose wave vectors are normally distributed with the standard deviation
        sqrt(2) / correlation_length per axis: the Fourier transform of the correlation.

        Parameters
        ----------
        points : (P, 3) ndarray
            Positions in mm.

        Returns
        -------
        (P,) ndarray
            Heights above the mean surface, mm.
        """
        rng = np.random.default_rng(self.seed)
        waves = rng.normal(scale=math.sqrt(2) / self.correlation_length, size=(3, RANDOM_WAVES))
        phases = rng.uniform(0, 2 * math.pi, RANDOM_WAVES)
        total = np.empty(len(points))
        for start in range(0, len(points), 16384):
            here = slice(start, start + 16384)
            # Single precision is accurate to 1e-4 of the height, and several times faster.
            total[here] = np.cos((points[here] @ waves + phases).astype(np.float32)).sum(axis=1)
        return self.rms_height * math.sqrt(2 / RANDOM_WAVES) * total


class BluntHeights(RandomRoughness):
    """A random finish with reduced slopes, for an estimate of the error due to flat triangles.

    Between heights, triangles are linear, and on average less steep than the surface. These slopes are reduced by 1 /
    `FACETS_SHARE` times the slope that triangles lose.
    """

    def relief(self, smooth: SmoothSurface) -> Relief:
        offset = super().relief(smooth).offset
        triangles = smooth.triangles[smooth.rough]
        edges = np.unique(np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1), axis=0)
        height = np.einsum("vi,vi->v", offset, smooth.unit_offset)
        height /= np.maximum(np.square(smooth.unit_offset).sum(axis=1), np.finfo(float).tiny)
        ends, others = edges.T.ravel(), edges[:, ::-1].T.ravel()
        number = np.bincount(ends, minlength=len(height))
        mean = np.bincount(ends, height[others], len(height)) / np.maximum(number, 1)
        return Relief.of_vertices(smooth, (height + BLUNTING * (mean - height))[:, None] * smooth.unit_offset)


def _unit(direction: Sequence[float]) -> np.ndarray:
    return np.asarray(direction) / np.linalg.norm(direction)
