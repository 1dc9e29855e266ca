"""The reading of one cell and its derivatives, by one linear system and its adjoint.

Let W(x) be the response of the phototransistor to a watt incident at x on the walls. It receives D(x) directly, and the
rest via other walls: W = D + K W. With the power B from the LED on the walls, the reading is P = B . W, and with the
adjoint A = B + K^T A it changes by dP = dB . W + A . (dD + dK W). W is known at the points of a quadrature rule on each
patch (Nystrom's method), and a polynomial in between. Source: K. E. Atkinson, The Numerical Solution of Integral
Equations of the Second Kind, Cambridge University Press, 1997.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.linalg import lu_factor, lu_solve

from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.direct import Direct
from mitsuba_taxel.transport.emission import STEP, Emission, emission
from mitsuba_taxel.transport.exchange import Exchange, LightRates, Starts
from mitsuba_taxel.transport.horizon import PiecesAtHorizon, pieces_at_horizon
from mitsuba_taxel.transport.laws.ends import End
from mitsuba_taxel.transport.pairs import pairs_of
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.reception import Reception, accepted, radiance
from mitsuba_taxel.transport.rules import triangle_rule

DISTANCE = 0.8
"""As for :func:`cut_near`: with twice the value, readings change by 3e-5 and derivatives by 2e-4."""
BEND = 1e-5
"""Movement in mm of the walls that shows how light begins to pass between points of one plane."""


@dataclass(frozen=True, eq=False)
class ScatteringWalls:
    """The patches of a cell that scatter light.

    Attributes
    ----------
    places, rest : (F, 15, 3) ndarray
        Deformed and undeformed positions in mm.
    isotropic, lambertian : (F,) ndarray
        Share of the incident light that each scatters with this law.
    of_box : int
        Number of the last patches, which lie on the box: LED and phototransistor at its top do not see them, and it
        does not stand between them and others.
    have_edges : bool
        Whether walls meet at edges, at which isotropic light of one passes along the horizon of its points onto
        another: patches that the horizon crosses count by the share above it.
    """

    places: np.ndarray
    rest: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray
    of_box: int = 0
    have_edges: bool = False

    @property
    def seen(self) -> np.ndarray:
        """Patches that LED and phototransistor see."""
        return self.places[: len(self.places) - self.of_box]


class Mesh:
    """Quadrature on the walls of a cell, determined by the undeformed state and the same for all loads.

    Parameters
    ----------
    rest : (F, 15, 3) ndarray
        Positions of the undeformed patches in mm, anywhere in space.
    degree : int
        Of the polynomials: 2, or 1 for a coarser solution.

    Attributes
    ----------
    own : (T,) ndarray
        Number of the patch of each target.
    targets : PatchPoints
        The points at which W is known.
    pairs : Pairs
        Of targets and the points of the integral over all patches for each.
    first_pairs : (T + 1,) ndarray
        Number of the first pair of each target, and of all pairs.
    shares : (P, T) csr_matrix
        Weights of the known values of W for the value at each point of the integral.
    """

    def __init__(self, rest: np.ndarray, degree: int = 2) -> None:
        rule, _ = triangle_rule(degree)
        self.degree = degree
        self.own = np.repeat(np.arange(len(rest)), len(rule))
        self.targets = PatchPoints(self.own, np.tile(rule, (len(rest), 1)))
        self.pairs = pairs_of(self.targets.places(rest), rest, self.own, degree, DISTANCE)
        self.first_pairs = np.searchsorted(self.pairs.target, np.arange(len(self.own) + 1))
        self.shares = self._shares()

    def _shares(self) -> sparse.csr_matrix:
        points, size = self.pairs.shares.shape
        known = self.pairs.points.face[:, None] * size + np.arange(size)
        starts = np.arange(0, known.size + 1, size)
        return sparse.csr_matrix((self.pairs.shares.ravel(), known.ravel(), starts), shape=(points, len(self.own)))

    def by_target(self, vectors: list[np.ndarray]) -> np.ndarray:
        """(T, 3) sums of vectors with components (N,) over the pairs of each target."""
        return np.stack([np.add.reduceat(vector, self.first_pairs[:-1]) for vector in vectors], axis=1)


class Cell:
    """A cell in one state, with its LED and phototransistor, which may be at the top of a ``box``."""

    def __init__(
        self, mesh: Mesh, walls: ScatteringWalls, led: End, phototransistor: End, box: Box | None = None
    ) -> None:
        self._mesh, self._walls = mesh, walls
        self._led, self._phototransistor = led, phototransistor
        self._at, self._area = mesh.targets.placed(walls.places)
        self._length = np.linalg.norm(self._area, axis=1, keepdims=True)
        self._normal = self._area / self._length
        self._starts = Starts(self._at, self._normal, walls.isotropic[mesh.own], walls.lambertian[mesh.own])
        self._seen = slice(len(walls.seen) * len(mesh.own) // len(walls.places))
        self._emission = self._emission_of(led, phototransistor)
        self._reception = Reception(phototransistor, self._seen_starts)
        self._direct = self._direct_of(self._emission, phototransistor, self._reception)
        self._box, self._exchange = box, self._exchanged(self._between_walls(box))
        kept = lu_factor(np.eye(len(mesh.own)) - self._exchange)
        self.response = lu_solve(kept, self._of_all(self._reception.value))
        self._adjoint = lu_solve(kept, self.emitted, trans=1)
        self._gradients: dict[float, np.ndarray] = {}

    @property
    def emitted(self) -> np.ndarray:
        """(T,) shares of the LED's power for each of the points at which the response is known."""
        return self._of_all(self._emission.power)

    @property
    def reading(self) -> float:
        """Power on the phototransistor, in W per W of the LED."""
        return float(self.emitted @ self.response) + self._direct.value

    @property
    def emission_error(self) -> float:
        """Error of the reading by the power of the LED on each patch, as that within its outline is known, in W per W.

        It is multiplied by the mean response to the light on the patch.
        """
        return abs(float(self._emission.deviation @ self._mean_response))

    @cached_property
    def reception_error(self) -> float:
        """Error of the reading by what the phototransistor accepts from each patch, in W per W; see :func:`acceptance`.

        It is that of all patches together, and of each as if they were independent.
        """
        errors = self._reception_errors(self._walls.seen)
        return float(np.hypot(errors.sum(), np.linalg.norm(errors)))

    def conservation_slope_error(self, velocity: np.ndarray) -> float:
        """Error of the derivative of the reading, for walls that move along a velocity (F, 15, 3), by what the walls
        receive from the LED and what the phototransistor accepts from them."""
        lit, response = self._emission, self._mean_response
        gradient = lit.gradient(*(response[each.points.face] for each in (lit.inside, lit.edge)))
        velocity = velocity[: len(gradient)]
        by_emission = (gradient * velocity).sum() - lit.outline_rate(velocity) @ response
        fastest = np.abs(velocity).max(initial=0)
        if not fastest:
            return abs(float(by_emission))
        step = STEP / fastest
        ahead, behind = (self._reception_errors(self._walls.seen + sign * step * velocity) for sign in (1, -1))
        return float(np.hypot(by_emission, (ahead - behind).sum() / (2 * step)))

    def _reception_errors(self, places: np.ndarray) -> np.ndarray:
        """Errors by what the phototransistor accepts from each patch that it sees, with all of its light, or with what
        comes from other walls alone if the light of the LED is followed on parts of patches, and from each of these."""
        by_rule, by_outline = accepted(self._phototransistor, places, self._mesh.degree)
        errors = self._radiance * (by_rule - by_outline)
        return np.concatenate([errors, self._direct.reception_errors(places)]) if self._direct.is_finer else errors

    @cached_property
    def _radiance(self) -> np.ndarray:
        """(F,) radiance of each patch towards the phototransistor, in the light of :meth:`_reception_errors`."""
        count, degree = len(self._walls.seen), self._mesh.degree
        power, received = self._adjoint[self._seen], self._reception.value
        if self._direct.is_finer:
            power = power - self._emission.power
        area = self._length[self._seen].reshape(count, -1) @ triangle_rule(degree)[1]
        scattered = (self._walls.isotropic + self._walls.lambertian)[:count]
        return radiance(
            self._phototransistor,
            (power * received).reshape(count, -1).sum(axis=1),
            scattered * power.reshape(count, -1).sum(axis=1),
            area,
            *accepted(self._phototransistor, self._walls.seen, degree),
        )

    @cached_property
    def _mean_response(self) -> np.ndarray:
        """(F,) mean response to the light of the LED on each patch, or to all light where there is none."""
        response = self.response[self._seen].reshape(len(self._walls.seen), -1)
        power = np.abs(self._emission.power).reshape(response.shape)
        weight = np.where(power.sum(axis=1, keepdims=True) > 0, power, 1.0)
        return (weight * response).sum(axis=1) / weight.sum(axis=1)

    def flows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Samples of the light paths: from the LED, from wall to wall, and to the phototransistor.

        Returns
        -------
        sources, ends : (M, 2, 3) ndarray
            Positions in mm, and unit normals; from wall to wall, one for each patch that receives light from a point.
        share : (M,) ndarray
            Share of the reading on this segment; light via several walls counts several times.
        """
        count, size = len(self._walls.places), len(self._at) // len(self._walls.places)
        shares = self._adjoint[:, None] * self._exchange * self.response
        target, patch = np.nonzero(between := shares.reshape(-1, count, size).sum(axis=2))
        walls = np.stack([self._at, self._normal], axis=1)
        led, phototransistor = (
            np.broadcast_to(np.stack([end.points.mean(axis=0), end.normal]), walls.shape)
            for end in (self._led, self._phototransistor)
        )
        sources, ends = (led, walls[target], walls), (walls, walls[patch * size + target % size], phototransistor)
        received = self._adjoint * self._of_all(self._reception.value)
        into = np.concatenate([self.emitted * self.response, between[target, patch], received])
        return np.concatenate(sources), np.concatenate(ends), into / (self.reading or 1.0)

    def _between_walls(self, box: Box | None) -> Exchange:
        """Exchange from the points at which W is known to those of all patches, with a box between them if given."""
        pairs, places = self._mesh.pairs, self._walls.places
        return Exchange(self._starts, *pairs.points.placed(places), pairs.target, pairs.point, *self._standing(box))

    def _standing(self, box: Box | None) -> tuple[Box | None, np.ndarray | None]:
        """The box, if it may stand between walls, and between which pairs."""
        if box is None or not box.below_top(self._walls.seen):
            return None, None
        pairs, last = self._mesh.pairs, len(self._walls.seen)
        walls = (self._mesh.own[pairs.target] < last) & (pairs.points.face[pairs.point] < last)
        return box, None if self._walls.of_box == 0 else walls

    @property
    def _seen_starts(self) -> Starts:
        """Of the walls that LED and phototransistor see."""
        return Starts(*(getattr(self._starts, field.name)[self._seen] for field in fields(Starts)))

    def _of_all(self, values: np.ndarray) -> np.ndarray:
        """(T, ...) values at all points, 0 at those on the box, from those at the others."""
        beyond = len(self._at) - len(values)
        return np.pad(values, [(0, beyond), *[(0, 0)] * (values.ndim - 1)]) if beyond else values

    def _direct_of(self, emission: Emission, phototransistor: End, reception: Reception) -> Direct:
        return Direct(emission, phototransistor, self._walls.isotropic, self._walls.lambertian, reception.value)

    def _emission_of(self, led: End, phototransistor: End) -> Emission:
        seen = self._walls.seen
        return emission(led, seen, self._walls.rest[: len(seen)], self._mesh.degree, phototransistor)

    def _exchanged(self, between: Exchange) -> np.ndarray:
        """(T, T) K."""
        pairs, shares = self._mesh.pairs, self._mesh.shares
        values = between.values()
        if (crossing := self._crossing(between)) is not None:
            values[crossing.pairs] = between.part(crossing.pairs).values(crossing.share)
        values *= pairs.weight
        return (sparse.csr_matrix((values, pairs.point, self._mesh.first_pairs), shares.shape[::-1]) @ shares).toarray()

    def _crossing(self, between: Exchange) -> PiecesAtHorizon | None:
        """Pieces that the horizon of isotropic light crosses, where walls meet at edges."""
        if not (self._walls.have_edges and self._walls.isotropic.any()):
            return None
        crossing = pieces_at_horizon(self._mesh.pairs, self._mesh.own, self._normal, between.leaving())
        return crossing if len(crossing.pairs) else None

    def _slopes(self, given: np.ndarray, wider: float) -> LightRates:
        """Derivatives of the exchange between walls, times ``given`` (N,)."""
        between = self._between_walls(self._box)
        slopes = between.slopes(given, wider)
        if (crossing := self._crossing(between)) is None:
            return slopes
        part, given = between.part(crossing.pairs), given[crossing.pairs]
        ones = np.ones_like(given)
        isotropic = given * (part.values(ones) - part.values(0 * ones))
        by_share = isotropic.reshape(crossing.by_height.shape).sum(axis=1, keepdims=True)
        rates = part.slopes(given, wider, crossing.share, (by_share * crossing.by_height).ravel())
        for field in fields(LightRates):
            for whole, crossed in zip(getattr(slopes, field.name) or (), getattr(rates, field.name) or (), strict=True):
                whole[crossing.pairs] = crossed
        return slopes

    def gradient(self, wider: float = 1.0) -> np.ndarray:
        """(F, 15, 3) derivatives of the reading by the positions of the patches, per mm; see
        :meth:`Exchange.slopes`. They are kept, as studies ask for them again."""
        if wider not in self._gradients:
            self._gradients[wider] = self._gradient(wider)
        return self._gradients[wider]

    def _gradient(self, wider: float) -> np.ndarray:
        pairs, mesh, places = self._mesh.pairs, self._mesh, self._walls.places
        points, size = pairs.shares.shape
        response = np.einsum("pq,pq->p", pairs.shares, self.response.reshape(-1, size)[pairs.points.face])
        given = pairs.weight * self._adjoint[pairs.target] * response[pairs.point]
        slopes = self._slopes(given, wider)  # whose pairs take four times a cell's memory
        adjoint = self._adjoint[self._seen] - self._emission.power
        by_start, by_normal = map(self._of_all, self._reception.gradient(adjoint, wider))
        by_start -= mesh.by_target(slopes.by_end)
        by_start += 0 if slopes.by_both is None else mesh.by_target(slopes.by_both)
        by_normal += mesh.by_target(slopes.by_normal)
        by_area = (by_normal - (by_normal * self._normal).sum(axis=1, keepdims=True) * self._normal) / self._length
        by_end, by_facing = (
            np.stack([np.bincount(pairs.point, part, points) for part in each], axis=1)
            for each in (slopes.by_end, slopes.by_area)
        )
        total = pairs.points.gradient(places, by_end, by_facing) + mesh.targets.gradient(places, by_start, by_area)
        total[: len(self._walls.seen)] += self._emission.gradient(*self._at_lit_points) + self._direct.gradient(wider)
        return total

    @property
    def _at_lit_points(self) -> list[np.ndarray]:
        """Responses at points lit inside the cone and at its edge."""
        lit, response = self._emission, self.response[self._seen]
        return [lit.at(each, response) + self._direct.missing(each) for each in (lit.inside, lit.edge)]

    def bent(self, velocity: np.ndarray, side: int) -> np.ndarray:
        """(F,) derivatives of the light between points of one plane, which :meth:`gradient` leaves out, by the patch
        that it leaves, for walls that move along a velocity (F, 15, 3): where they begin to, for ``side`` 1, or come
        to their places, for -1. Points of a plane see each other when it is bent inwards, and not when outwards."""
        pairs, own, places = self._mesh.pairs, self._mesh.own, self._walls.places
        fastest = np.abs(velocity).max()
        if not (fastest > 0 and self._in_plane.any()):
            return np.zeros(len(places))
        target, point = pairs.target[self._in_plane], pairs.point[self._in_plane]
        given = pairs.weight[self._in_plane] * self._adjoint[target] * (self._mesh.shares @ self.response)[point]
        step = side * BEND / fastest
        moved = places + step * velocity
        at, area = self._mesh.targets.placed(moved)
        starts = replace(self._starts, at=at, normal=area / np.linalg.norm(area, axis=1, keepdims=True))
        box, walls = self._standing(self._box)
        between = None if walls is None else walls[self._in_plane]
        light = Exchange(starts, *pairs.points.placed(moved), target, point, box, between)
        return np.bincount(own[target], given * light.values() / step, len(places))

    @cached_property
    def _in_plane(self) -> np.ndarray:
        """(N,) which pairs are of points in one plane."""
        return self._between_walls(None).in_plane()

    def change(self, led: End, phototransistor: End, box: Box | None, scattered: np.ndarray) -> float:
        """First-order change of the reading.

        Parameters
        ----------
        led, phototransistor : End
        box : Box or None
            Their changed values.
        scattered : (F,) ndarray
            Changed scattering of each patch, relative to the present one.
        """
        change = 0.0
        if led != self._led:
            lit = self._emission_of(led, self._phototransistor)
            change += (lit.power - self._emission.power) @ self.response[self._seen]
            change += self._direct_of(lit, self._phototransistor, self._reception).value - self._direct.value
        if phototransistor != self._phototransistor:
            received = Reception(phototransistor, self._seen_starts)
            change += self._adjoint[self._seen] @ (received.value - self._reception.value)
            change += self._direct_of(self._emission, phototransistor, received).value - self._direct.value
        if box != self._box:
            exchange = self._exchanged(self._between_walls(box))
            change += self._adjoint @ ((exchange - self._exchange) @ self.response)
        change += self._direct.by_patch() @ (scattered[: len(self._walls.seen)] - 1)
        return float(change + self._adjoint @ ((scattered[self._mesh.own] - 1) * self.response))
