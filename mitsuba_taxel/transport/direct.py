"""Light that a phototransistor receives directly from lit walls.

Polynomials on patches interpolate the response of the walls. Most of an LED's light falls on a few of them, so that
their errors do not average out, and neither do those of slopes as the walls move. Most of it is that of the direct
response, which needs no solution: it is interpolated by polynomials of fourth degree, on parts of patches that are
small beside their distance from the phototransistor below a narrow beam, and where its response is narrow.
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
"""Most subdivisions of patches."""
_NODES = 1 / 3 + 0.8 * (LATTICE - 1 / 3)
"""(15, 2) coordinates (s, t) where the response is known: within patches, as it may end at their rim."""
_COEFFICIENTS = np.linalg.inv(monomials(_NODES, DEGREE))
"""(15, 15) from values there to the polynomial through them."""


class Direct:
    """What the coarser interpolation of the direct response leaves out of a reading.

    Parameters
    ----------
    emission : Emission
    phototransistor : End
    isotropic, lambertian : (F,) ndarray
        Share of the incident light that each patch scatters with this law.
    known : (F * Q,) ndarray
        Direct response at the points of the patches, as :class:`Emission` interpolates it.
    """

    def __init__(
        self, emission: Emission, phototransistor: End, isotropic: np.ndarray, lambertian: np.ndarray, known: np.ndarray
    ) -> None:
        self._emission, self._phototransistor, self._known = emission, phototransistor, known
        self._scattered = isotropic + lambertian
        self._parts = _Parts(emission, phototransistor)
        own = np.repeat(self._parts.face, len(_NODES))
        self._points = PatchPoints(own, self._parts.nodes)
        at, area = self._points.placed(emission.places)
        self._length = np.linalg.norm(area, axis=1, keepdims=True)
        self._normal = area / self._length
        self._reception = Reception(phototransistor, Starts(at, self._normal, isotropic[own], lambertian[own]))
        into = self._parts.of_inside[:, None] * len(_NODES) + np.arange(len(_NODES))
        lit = emission.lit[:, None] * self._parts.shares(emission.inside, self._parts.of_inside)
        self._power = np.bincount(into.ravel(), lit.ravel(), len(own))

    @property
    def value(self) -> float:
        """In W per W of the LED."""
        return float(self.by_patch().sum())

    def by_patch(self) -> np.ndarray:
        """(F,) the same, by the patch that is lit."""
        count = len(self._emission.places)
        finer = np.bincount(self._points.face, self._power * self._reception.value, count)
        return finer - (self._emission.power * self._known).reshape(count, -1).sum(axis=1)

    def missing(self, lit: LitPoints) -> np.ndarray:
        """(N,) direct responses at lit points, less those of the coarser interpolation."""
        part = self._parts.of_inside if lit is self._emission.inside else self._parts.of_edge
        finer = self._reception.value.reshape(-1, len(_NODES))[part]
        return np.einsum("nq,nq->n", self._parts.shares(lit, part), finer) - self._emission.at(lit, self._known)

    @property
    def is_finer(self) -> bool:
        """Whether patches are cut into parts."""
        return len(self._parts.face) != len(self._emission.places) or bool((self._parts.side != 1).any())

    def reception_errors(self, places: np.ndarray) -> np.ndarray:
        """(M,) errors of the reading in W per W by what the phototransistor accepts from each part of patches that have
        moved to ``places`` (F, 15, 3)."""
        by_rule, by_outline = accepted(self._phototransistor, self._parts.placed(places), self._emission.degree)
        return self._radiance * (by_rule - by_outline)

    @cached_property
    def _radiance(self) -> np.ndarray:
        """(M,) of each part in the light of the LED alone."""
        by_rule, by_outline = accepted(
            self._phototransistor, self._parts.placed(self._emission.places), self._emission.degree
        )
        power, received = self._power.reshape(-1, len(_NODES)), self._reception.value.reshape(-1, len(_NODES))
        area = self._length.reshape(power.shape).mean(axis=1) * self._parts.side**2 / 2
        scattered = self._scattered[self._parts.face] * power.sum(axis=1)
        return radiance(self._phototransistor, (power * received).sum(axis=1), scattered, area, by_rule, by_outline)

    def gradient(self, wider: float) -> np.ndarray:
        """(F, 15, 3) derivatives by the patches' positions through the finer direct response alone."""
        by_start, by_normal = self._reception.gradient(self._power, wider)
        across = by_normal - (by_normal * self._normal).sum(axis=1, keepdims=True) * self._normal
        return self._points.gradient(self._emission.places, by_start, across / self._length)


class _Parts:
    """Equal triangular parts of patches, on each of which a polynomial interpolates.

    Attributes
    ----------
    face : (M,) ndarray
        Number of the patch of each part, in ascending order.
    side : (M,) ndarray
        Their size relative to the patch, negative for those turned by half a turn.
    of_inside, of_edge : (N,) ndarray
        Number of the part of each point that is lit.
    """

    def __init__(self, emission: Emission, phototransistor: End) -> None:
        count = len(emission.places)
        if not len(emission.lit):
            self.face, self._origin, self.side = np.arange(count), np.zeros((count, 2)), np.ones(count)
            self.of_inside, self.of_edge = emission.inside.points.face, emission.edge.points.face
            return
        middle, size = Pieces(np.arange(count), np.broadcast_to(WHOLE, (count, 3, 2))).extents(emission.places)
        distance = np.linalg.norm(middle - phototransistor.points.mean(axis=0), axis=1)
        resolved = phototransistor.resolved(middle, size)
        if emission.led.law.spread < NARROW:
            resolved = np.minimum(resolved, distance)
        resolved *= emission.led.fineness
        cuts = np.clip(np.ceil(np.log2(np.maximum(size / resolved, 1))), 0, MOST_CUTS)
        points = [each.points for each in (emission.inside, emission.edge)]
        face, at = np.concatenate([point.face for point in points]), np.concatenate([point.at for point in points])
        # Part (i, j) of n x n, the lower or the upper triangle of its square, but for those above the hypotenuse.
        n = 2.0 ** cuts[face]
        corner = np.clip(np.floor(at * n[:, None]), 0, n[:, None] - 1)
        corner[:, 0] = np.minimum(corner[:, 0], n - 1 - corner[:, 1])
        upper = (at * n[:, None] - corner).sum(axis=1) > 1
        upper &= corner.sum(axis=1) < n - 1
        rows = np.column_stack([face, corner, upper])
        first, part = unique_rows(rows)
        keys = rows[first]
        self.of_inside, self.of_edge = part[: len(points[0].face)], part[len(points[0].face) :]
        self.face = keys[:, 0].astype(int)
        n, upper = 2.0 ** cuts[self.face], keys[:, 3]
        self._origin = (keys[:, 1:3] + upper[:, None]) / n[:, None]
        self.side = (1 - 2 * upper) / n

    def placed(self, places: np.ndarray) -> np.ndarray:
        """(M, 15, 3) positions of the parts as patches of their own."""
        at = self._origin[:, None] + self.side[:, None, None] * LATTICE
        points = PatchPoints(np.repeat(self.face, len(LATTICE)), at.reshape(-1, 2))
        return points.places(places).reshape(-1, len(LATTICE), 3)

    @cached_property
    def nodes(self) -> np.ndarray:
        """(M * 15, 2) coordinates (s, t) of the points on parts at which the response is known."""
        return (self._origin[:, None] + self.side[:, None, None] * _NODES).reshape(-1, 2)

    def shares(self, lit: LitPoints, part: np.ndarray) -> np.ndarray:
        """(N, 15) weights of the values at the nodes of their parts for those at lit points."""
        at = (lit.points.at - self._origin[part]) / self.side[part, None]
        return monomials(at, DEGREE) @ _COEFFICIENTS
