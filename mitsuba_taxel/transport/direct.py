"""Light that a phototransistor receives directly from lit walls, interpolated more finely than other light.

Polynomials on patches interpolate the response of the phototransistor to light on the walls. Most of an LED's light
falls on a few patches, so that their interpolation errors do not average out, neither in readings nor in slopes. Most
of the error is that of the direct response, which is computed without solving a system. It is therefore interpolated by
polynomials of fourth degree. Below a narrow beam, and where the response is narrow, patches are divided for this into
subpatches that are small compared with their distance from the phototransistor.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.transport.emission import Emission, LitPoints
from mitsuba_taxel.transport.exchange import Starts
from mitsuba_taxel.transport.laws.ends import NARROW, End
from mitsuba_taxel.transport.patches import DEGREE, LATTICE, PatchPoints
from mitsuba_taxel.transport.pieces import WHOLE, Pieces
from mitsuba_taxel.transport.reception import Reception, accepted, radiance
from mitsuba_taxel.transport.rules import monomials

MOST_CUTS = 9
"""Largest number of subdivisions of a patch."""
_NODES = 1 / 3 + 0.8 * (LATTICE - 1 / 3)
"""Coordinates (s, t) (15, 2) of the interpolation nodes, which lie inside the patches because the response may jump to
0 at their rim."""
_COEFFICIENTS = np.linalg.inv(monomials(_NODES, DEGREE))
"""Matrix (15, 15) from values at the nodes to the coefficients of the polynomial through them."""


class Direct:
    """Correction of a reading by finer interpolation of the light that the phototransistor receives directly from the
    walls.

    Parameters
    ----------
    emission : Emission
        Light of the LED on the walls.
    phototransistor : End
        Phototransistor that receives it.
    isotropic, lambertian : (F,) ndarray
        Fraction of the incident light that each patch scatters by the law of this name.
    coarse : (F * Q,) ndarray
        Direct response at the Q points of each of F patches, as :class:`Emission` interpolates it.
    """

    def __init__(
        self,
        emission: Emission,
        phototransistor: End,
        isotropic: np.ndarray,
        lambertian: np.ndarray,
        coarse: np.ndarray,
    ) -> None:
        self._emission, self._phototransistor, self._coarse = emission, phototransistor, coarse
        self._scattered = isotropic + lambertian
        # The response at the nodes of the subpatches.
        self._subpatches = subpatches = _Subpatches(emission, phototransistor)
        own = np.repeat(subpatches.face, len(_NODES))
        self._points = PatchPoints(own, subpatches.nodes)
        at, area = self._points.positions_and_areas(emission.positions)
        self._length = np.linalg.norm(area, axis=1, keepdims=True)
        self._normal = area / self._length
        self._reception = Reception(phototransistor, Starts(at, self._normal, isotropic[own], lambertian[own]))
        # The LED's power for each of these nodes.
        node = subpatches.of_inside[:, None] * len(_NODES) + np.arange(len(_NODES))
        lit = emission.lit[:, None] * subpatches.interpolation(emission.inside, subpatches.of_inside)
        self._power = np.bincount(node.ravel(), lit.ravel(), len(own))

    @property
    def value(self) -> float:
        """Correction of the reading by the finer interpolation, in W per W of the LED."""
        return float(self.by_patch().sum())

    def by_patch(self) -> np.ndarray:
        """Correction (F,) of the reading by the finer interpolation, for the light on each of F patches, in W per W of
        the LED.
        """
        count = len(self._emission.positions)
        finer = np.bincount(self._points.face, self._power * self._reception.value, count)
        return finer - (self._emission.power * self._coarse).reshape(count, -1).sum(axis=1)

    def correction(self, lit: LitPoints) -> np.ndarray:
        """Correction (N,) of the direct response at N lit points: its finer interpolation minus the coarser
        interpolation.
        """
        subpatches = self._subpatches
        number = subpatches.of_inside if lit is self._emission.inside else subpatches.of_edge
        finer = self._reception.value.reshape(-1, len(_NODES))[number]
        return np.einsum("nq,nq->n", subpatches.interpolation(lit, number), finer) - self._emission.at(
            lit, self._coarse
        )

    @property
    def is_finer(self) -> bool:
        """Whether any patch is divided into subpatches, on which the direct response is interpolated."""
        return len(self._subpatches.face) != len(self._emission.positions) or bool((self._subpatches.side != 1).any())

    def reception_errors(self, positions: np.ndarray | None = None) -> np.ndarray:
        """Errors of the reading due to the light that the phototransistor accepts from each subpatch.

        Parameters
        ----------
        positions : (F, 15, 3) ndarray, optional
            Positions of the patches if they have moved; in mm.

        Returns
        -------
        (M,) ndarray
            Errors in W per W of the LED, for each of M subpatches.
        """
        by_rule, by_outline = self._accepted if positions is None else self._accepted_at(positions)
        return self._radiance * (by_rule - by_outline)

    @cached_property
    def _accepted(self) -> tuple[np.ndarray, np.ndarray]:
        return self._accepted_at(self._emission.positions)

    def _accepted_at(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return accepted(self._phototransistor, self._subpatches.positions(positions), self._emission.degree)

    @cached_property
    def _radiance(self) -> np.ndarray:
        """Radiance (M,) of each subpatch in the light of the LED alone, in W per mm² and sr per W of the LED."""
        by_rule, by_outline = self._accepted
        power, received = self._power.reshape(-1, len(_NODES)), self._reception.value.reshape(-1, len(_NODES))
        area = self._length.reshape(power.shape).mean(axis=1) * self._subpatches.side**2 / 2
        scattered = self._scattered[self._subpatches.face] * power.sum(axis=1)
        return radiance(self._phototransistor, (power * received).sum(axis=1), scattered, area, by_rule, by_outline)

    def gradient(self, wider: float) -> np.ndarray:
        """Derivatives (F, 15, 3), with respect to the positions of the patches, of the light that the finer
        interpolation gives. ``wider`` is explained at :meth:`Reception.gradient`.
        """
        by_start, by_normal = self._reception.gradient(self._power, wider)
        across = by_normal - (by_normal * self._normal).sum(axis=1, keepdims=True) * self._normal
        return self._points.gradient(self._emission.positions, by_start, across / self._length)


class _Subpatches:
    """Equal triangles into which patches are divided, with an interpolation polynomial on each; the M lit triangles are
    kept.

    Attributes
    ----------
    face : (M,) ndarray
        Number of the patch of each subpatch, in ascending order.
    side : (M,) ndarray
        Size of the subpatch relative to the patch, negative if it is rotated by half a turn.
    of_inside, of_edge : (N,) ndarray
        Number of the subpatch of each lit point.
    """

    def __init__(self, emission: Emission, phototransistor: End) -> None:
        count = len(emission.positions)
        if not len(emission.lit):
            self.face, self._origin, self.side = np.arange(count), np.zeros((count, 2)), np.ones(count)
            self.of_inside, self.of_edge = emission.inside.points.face, emission.edge.points.face
            return
        # The number of divisions of each patch follows from the length over which the response varies there.
        middle, size = Pieces(np.arange(count), np.broadcast_to(WHOLE, (count, 3, 2))).extents(emission.positions)
        distance = np.linalg.norm(middle - phototransistor.points.mean(axis=0), axis=1)
        resolved = phototransistor.resolved(middle, size)
        if emission.led.law.spread < NARROW:
            resolved = np.minimum(resolved, distance)
        resolved *= emission.led.fineness
        cuts = np.clip(np.ceil(np.log2(np.maximum(size / resolved, 1))), 0, MOST_CUTS)
        inside, edge = emission.inside.points, emission.edge.points
        face, at = np.concatenate([inside.face, edge.face]), np.concatenate([inside.at, edge.at])
        # A lit point lies in the square (i, j) of n x n: in its upper triangle, unless that is outside the patch, or
        # the lower one.
        n = 2.0 ** cuts[face]
        corner = np.clip(np.floor(at * n[:, None]), 0, n[:, None] - 1)
        corner[:, 0] = np.minimum(corner[:, 0], n - 1 - corner[:, 1])
        upper = (at * n[:, None] - corner).sum(axis=1) > 1
        upper &= corner.sum(axis=1) < n - 1
        rows = np.column_stack([face, corner, upper])
        # Each triangle with a lit point is a subpatch.
        first, number = unique_rows(rows)
        keys = rows[first]
        self.of_inside, self.of_edge = number[: len(inside.face)], number[len(inside.face) :]
        self.face = keys[:, 0].astype(int)
        n, upper = 2.0 ** cuts[self.face], keys[:, 3]
        self._origin = (keys[:, 1:3] + upper[:, None]) / n[:, None]
        self.side = (1 - 2 * upper) / n

    def positions(self, positions: np.ndarray) -> np.ndarray:
        """Positions (M, 15, 3) of the subpatches, from those (F, 15, 3) of the patches."""
        at = self._origin[:, None] + self.side[:, None, None] * LATTICE
        points = PatchPoints(np.repeat(self.face, len(LATTICE)), at.reshape(-1, 2))
        return points.interpolated(positions).reshape(-1, len(LATTICE), 3)

    @cached_property
    def nodes(self) -> np.ndarray:
        """Coordinates (s, t) (M * 15, 2) of the interpolation nodes of all subpatches on their patches."""
        return (self._origin[:, None] + self.side[:, None, None] * _NODES).reshape(-1, 2)

    def interpolation(self, lit: LitPoints, number: np.ndarray) -> np.ndarray:
        """Weights (N, 15) that interpolate values at lit points from values at the nodes of their subpatches, numbered
        by ``number``."""
        at = (lit.points.at - self._origin[number]) / self.side[number, None]
        return monomials(at, DEGREE) @ _COEFFICIENTS
