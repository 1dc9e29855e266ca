"""The reading of one cell and its derivatives, by one linear system and its adjoint.

Let W(x) be the response of the phototransistor to a watt that falls on the walls at x. It receives D(x) directly, and
the rest via other walls: W = D + K W, where K is the exchange of light between walls. With the power B of the LED on
the walls, the reading is P = B . W. With the adjoint A = B + K^T A, it changes by dP = dB . W + A . (dD + dK W). W is
solved for at the points of a quadrature rule on each patch (Nystrom's method), and interpolated by a polynomial in
between. Source: K. E. Atkinson, The Numerical Solution of Integral Equations of the Second Kind, Cambridge University
Press, 1997.
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
"""Argument ``distance`` of :func:`cut_near`: with twice this value, readings change by 3e-5 and derivatives by 2e-4."""
BEND = 1e-5
"""Displacement of the walls in mm, for the finite difference by which light between points of one plane is found."""


@dataclass(frozen=True, eq=False)
class ScatteringWalls:
    """The patches of a cell that scatter light.

    Attributes
    ----------
    positions, rest : (F, 15, 3) ndarray
        Deformed and undeformed positions of the 15 points of each of F patches, mm.
    isotropic, lambertian : (F,) ndarray
        Fraction of the incident light that each patch scatters with this law.
    of_box : int
        Number of patches on the box; these come last. LED and phototransistor lie in the top of the box: they do not
        see these patches, and the box does not block their light.
    have_edges : bool
        Whether walls meet at edges. Then the horizon of a point may cross a patch of another wall, which receives
        isotropic light in proportion to its fraction above the horizon.
    """

    positions: np.ndarray
    rest: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray
    of_box: int = 0
    have_edges: bool = False

    @property
    def seen(self) -> np.ndarray:
        """Positions in mm of the points of those patches that LED and phototransistor see: all except those on the box.
        """
        return self.positions[: len(self.positions) - self.of_box]


class Mesh:
    """Quadrature points on the walls of a cell, and the pairs of points between which light is exchanged.

    The points at which the response to light is computed are called targets. Points and pairs follow from the
    undeformed state and are the same for all loads.

    Parameters
    ----------
    rest : (F, 15, 3) ndarray
        Positions of the undeformed patches in mm; a translation has no effect.
    degree : int
        Degree of the polynomials: 2, or 1 for a coarser solution.

    Attributes
    ----------
    own : (T,) ndarray
        Number of the patch on which each of T targets lies.
    targets : PatchPoints
        The T points at which W is solved for.
    pairs : Pairs
        N pairs of a target with a point of the integral over all patches.
    first_pairs : (T + 1,) ndarray
        Number of the first pair of each target; the last entry is the number of pairs.
    interpolation : (P, T) csr_matrix
        Weights with which values of W at the targets are interpolated at the P points of the integrals.
    """

    def __init__(self, rest: np.ndarray, degree: int = 2) -> None:
        rule, _ = triangle_rule(degree)
        self.degree = degree
        self.own = np.repeat(np.arange(len(rest)), len(rule))
        self.targets = PatchPoints(self.own, np.tile(rule, (len(rest), 1)))
        self.pairs = pairs_of(self.targets.interpolated(rest), rest, self.own, degree, DISTANCE)
        self.first_pairs = np.searchsorted(self.pairs.target, np.arange(len(self.own) + 1))
        weights = self.pairs.interpolation
        points, size = weights.shape
        targets = self.pairs.points.face[:, None] * size + np.arange(size)
        rows = np.arange(0, targets.size + 1, size)
        self.interpolation = sparse.csr_matrix((weights.ravel(), targets.ravel(), rows), shape=(points, len(self.own)))

    def by_target(self, vectors: list[np.ndarray]) -> np.ndarray:
        """Sum the vectors of the pairs of each target: (T, 3), from the three components (N,) of the vectors of all N
        pairs.
        """
        return np.stack([np.add.reduceat(vector, self.first_pairs[:-1]) for vector in vectors], axis=1)


class Cell:
    """The light in one cell under one load: its path from the LED over the walls to the phototransistor.

    Parameters
    ----------
    mesh : Mesh
        Quadrature on its walls.
    walls : ScatteringWalls
        Patches of the walls; F is their number.
    led, phototransistor : End
        Ends of the path.
    box : Box, optional
        Box that blocks light between the walls; LED and phototransistor may lie in its top.

    Attributes
    ----------
    response : (T,) ndarray
        Response W(x) at the targets of the mesh, in W per W.
    """

    def __init__(
        self, mesh: Mesh, walls: ScatteringWalls, led: End, phototransistor: End, box: Box | None = None
    ) -> None:
        self._mesh, self._walls, self._box = mesh, walls, box
        self._led, self._phototransistor = led, phototransistor
        # The points of the walls at which W is solved for. Those on the box come last and see neither LED nor
        # phototransistor.
        self._at, self._area = mesh.targets.positions_and_areas(walls.positions)
        self._length = np.linalg.norm(self._area, axis=1, keepdims=True)
        self._normal = self._area / self._length
        self._starts = Starts(self._at, self._normal, walls.isotropic[mesh.own], walls.lambertian[mesh.own])
        self._seen = slice(len(walls.seen) * len(mesh.own) // len(walls.positions))
        # From the LED to the walls (B), from the walls to the phototransistor (D), and D interpolated more finely.
        self._emission = self._emission_of(led, phototransistor)
        self._reception = Reception(phototransistor, self._seen_starts)
        self._direct = self._direct_of(self._emission, phototransistor, self._reception)
        # From wall to wall (K). The response W and the adjoint A follow from one factorisation.
        self._exchange = self._exchange_of(self._between_walls(box))
        factors = lu_factor(np.eye(len(mesh.own)) - self._exchange)
        self.response = lu_solve(factors, self._of_all(self._reception.value))
        self._adjoint = lu_solve(factors, self.emitted, trans=1)
        self._gradients: dict[float, np.ndarray] = {}

    @property
    def emitted(self) -> np.ndarray:
        """Fraction (T,) of the LED's power that falls directly on the part of the wall around each target (quadrature
        point), so that sums over targets approximate integrals over walls.
        """
        return self._of_all(self._emission.power)

    @property
    def reading(self) -> float:
        """Power on the phototransistor, in W per W of the LED."""
        return float(self.emitted @ self.response) + self._direct.value

    @property
    def emission_error(self) -> float:
        """Error of the reading, in W per W, because the power of the LED on each patch is computed by quadrature.

        It is the deviation from the exact power within the outline of the patch, times the mean response to light on
        the patch.
        """
        return abs(float(self._emission.deviation @ self._mean_response))

    @cached_property
    def reception_error(self) -> float:
        """Error of the reading, in W per W, because the light that the phototransistor accepts from each patch is
        computed by quadrature.

        The error of a patch follows from the difference of the two integrals of :func:`acceptance`. The result is the
        root sum of squares of two quantities: the sum of the errors of all patches, and the root sum of their squares.
        """
        errors = self._reception_errors()
        return float(np.hypot(errors.sum(), np.linalg.norm(errors)))

    def conservation_slope_error(self, velocity: np.ndarray) -> float:
        """Error of a derivative of the reading, due to the quadrature of the light that the walls receive and that the
        phototransistor accepts.

        Parameters
        ----------
        velocity : (F, 15, 3) ndarray
            Velocity of the patches, in mm per unit of the parameter.

        Returns
        -------
        float
            Error in W per W and unit of the parameter.
        """
        lit, response = self._emission, self._mean_response
        gradient = lit.gradient(response[lit.inside.points.face], response[lit.edge.points.face])
        velocity = velocity[: len(gradient)]
        by_emission = (gradient * velocity).sum() - lit.outline_rate(velocity) @ response
        fastest = np.abs(velocity).max(initial=0)
        if not fastest:
            return abs(float(by_emission))
        step = STEP / fastest
        ahead, behind = (self._reception_errors(self._walls.seen + sign * step * velocity) for sign in (1, -1))
        return float(np.hypot(by_emission, (ahead - behind).sum() / (2 * step)))

    @cached_property
    def _accepted(self) -> tuple[np.ndarray, np.ndarray]:
        """Light that the phototransistor accepts from each patch that it sees, by quadrature over the patch and by
        integrals along its outline."""
        return accepted(self._phototransistor, self._walls.seen, self._mesh.degree)

    def _reception_errors(self, positions: np.ndarray | None = None) -> np.ndarray:
        """Errors of the reading, in W per W, because the light that the phototransistor accepts is computed by
        quadrature, for each patch that the phototransistor sees.

        Where patches are divided into subpatches for the light of the LED, the error of a patch contains only light
        from other walls, and the errors of the subpatches are appended. The patches may have moved to other
        ``positions``.
        """
        moved = None if positions is None else accepted(self._phototransistor, positions, self._mesh.degree)
        by_rule, by_outline = moved or self._accepted
        errors = self._radiance * (by_rule - by_outline)
        return np.concatenate([errors, self._direct.reception_errors(positions)]) if self._direct.is_finer else errors

    @cached_property
    def _radiance(self) -> np.ndarray:
        """Radiance (F,) of each patch towards the phototransistor, due to the light that :meth:`_reception_errors`
        considers."""
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
            *self._accepted,
        )

    @cached_property
    def _mean_response(self) -> np.ndarray:
        """Mean response W (F,) on each patch, weighted by the light of the LED; on patches without light of the LED,
        the unweighted mean."""
        response = self.response[self._seen].reshape(len(self._walls.seen), -1)
        power = np.abs(self._emission.power).reshape(response.shape)
        weight = np.where(power.sum(axis=1, keepdims=True) > 0, power, 1.0)
        return (weight * response).sum(axis=1) / weight.sum(axis=1)

    def flows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All M segments of light paths in the cell: from the LED, from wall to wall, and to the phototransistor.

        Returns
        -------
        sources, ends : (M, 2, 3) ndarray
            Positions in mm and unit normals at the start and at the end of each segment. From wall to wall, there is a
            segment from each target to each patch that receives its light.
        fraction : (M,) ndarray
            Fraction of the reading on this segment. Light via several walls counts several times.
        """
        count, size = len(self._walls.positions), len(self._at) // len(self._walls.positions)
        between = (self._adjoint[:, None] * self._exchange * self.response).reshape(-1, count, size).sum(axis=2)
        target, patch = np.nonzero(between)
        walls = np.stack([self._at, self._normal], axis=1)
        led, phototransistor = (
            np.broadcast_to(np.stack([end.points.mean(axis=0), end.normal]), walls.shape)
            for end in (self._led, self._phototransistor)
        )
        sources, ends = (led, walls[target], walls), (walls, walls[patch * size + target % size], phototransistor)
        received = self._adjoint * self._of_all(self._reception.value)
        power = np.concatenate([self.emitted * self.response, between[target, patch], received])
        return np.concatenate(sources), np.concatenate(ends), power / (self.reading or 1.0)

    def _between_walls(self, box: Box | None) -> Exchange:
        """Light exchange from the targets to the points of all patches, past the box, if any."""
        pairs = self._mesh.pairs
        ends = pairs.points.positions_and_areas(self._walls.positions)
        return Exchange(self._starts, *ends, pairs.target, pairs.point, *self._blocking(box))

    def _blocking(self, box: Box | None) -> tuple[Box | None, np.ndarray | None]:
        """The box, None if it is below all walls, and the mask (N,) of the pairs of points that it may block, None for
        all."""
        if box is None or not box.below_top(self._walls.seen):
            return None, None
        pairs, last = self._mesh.pairs, len(self._walls.seen)
        walls = (self._mesh.own[pairs.target] < last) & (pairs.points.face[pairs.point] < last)
        return box, None if self._walls.of_box == 0 else walls

    @property
    def _seen_starts(self) -> Starts:
        """Points of the walls that LED and phototransistor see, as points from which light starts."""
        return self._starts.block(self._seen)

    def _of_all(self, values: np.ndarray) -> np.ndarray:
        """Extend values at the targets on walls to an array (T, ...) of all targets, with 0 at the targets on the box.
        """
        on_box = len(self._at) - len(values)
        return np.pad(values, [(0, on_box), *[(0, 0)] * (values.ndim - 1)]) if on_box else values

    def _direct_of(self, emission: Emission, phototransistor: End, reception: Reception) -> Direct:
        return Direct(emission, phototransistor, self._walls.isotropic, self._walls.lambertian, reception.value)

    def _emission_of(self, led: End, phototransistor: End) -> Emission:
        seen = self._walls.seen
        return emission(led, seen, self._walls.rest[: len(seen)], self._mesh.degree, phototransistor)

    def _exchange_of(self, between: Exchange) -> np.ndarray:
        """Matrix K (T, T) of the light exchange between walls."""
        pairs, interpolation = self._mesh.pairs, self._mesh.interpolation
        values = between.values()
        if (crossing := self._crossing(between)) is not None:
            values[crossing.pairs] = between.subset(crossing.pairs).values(crossing.fraction)
        values *= pairs.weight
        to_points = sparse.csr_matrix((values, pairs.point, self._mesh.first_pairs), interpolation.shape[::-1])
        return (to_points @ interpolation).toarray()

    def _crossing(self, between: Exchange) -> PiecesAtHorizon | None:
        """Pieces of patches, for isotropic light, that the horizon of a target divides; None if walls do not meet at
        edges.
        """
        if not (self._walls.have_edges and self._walls.isotropic.any()):
            return None
        crossing = pieces_at_horizon(self._mesh.pairs, self._mesh.own, self._normal, between.leaving())
        return crossing if len(crossing.pairs) else None

    def _slopes(self, weight: np.ndarray, wider: float) -> LightRates:
        """Derivatives of the light exchanged between walls, multiplied by a weight (N,) of each pair of points."""
        between = self._between_walls(self._box)
        slopes = between.slopes(weight, wider)
        if (crossing := self._crossing(between)) is None:
            return slopes
        # On pieces that a horizon crosses, isotropic light is in proportion to the fraction above it.
        crossed, weight = between.subset(crossing.pairs), weight[crossing.pairs]
        ones = np.ones_like(weight)
        isotropic = weight * (crossed.values(ones) - crossed.values(0 * ones))
        by_fraction = isotropic.reshape(crossing.by_height.shape).sum(axis=1, keepdims=True)
        rates = crossed.slopes(weight, wider, crossing.fraction, (by_fraction * crossing.by_height).ravel())
        for field in fields(LightRates):
            for of_all, of_crossed in zip(
                getattr(slopes, field.name) or (), getattr(rates, field.name) or (), strict=True
            ):
                of_all[crossing.pairs] = of_crossed
        return slopes

    def gradient(self, wider: float = 1.0) -> np.ndarray:
        """Derivatives of the reading with respect to the positions of the walls' patches; later calls return the same
        array.

        Parameters
        ----------
        wider : float
            Factor of the width over which the step of light at horizons is smoothed; see :meth:`Exchange.slopes`.

        Returns
        -------
        (F, 15, 3) ndarray
            Derivatives in W per W and mm.
        """
        if wider in self._gradients:
            return self._gradients[wider]
        pairs, mesh, positions = self._mesh.pairs, self._mesh, self._walls.positions
        # From wall to wall, A . dK W: by the starts, which are the targets, and by the ends.
        points, size = pairs.interpolation.shape
        response = np.einsum("pq,pq->p", pairs.interpolation, self.response.reshape(-1, size)[pairs.points.face])
        weight = pairs.weight * self._adjoint[pairs.target] * response[pairs.point]
        slopes = self._slopes(weight, wider)  # these arrays take four times the memory of a cell
        # From the walls to the phototransistor, A . dD; the light of the LED is in the finer direct response below.
        adjoint = self._adjoint[self._seen] - self._emission.power
        by_start, by_normal = map(self._of_all, self._reception.gradient(adjoint, wider))
        by_start -= mesh.by_target(slopes.by_end)
        by_start += 0 if slopes.by_both is None else mesh.by_target(slopes.by_both)
        by_normal += mesh.by_target(slopes.by_normal)
        by_area = (by_normal - (by_normal * self._normal).sum(axis=1, keepdims=True) * self._normal) / self._length
        by_end, by_facing = (
            np.stack([np.bincount(pairs.point, component, points) for component in vector], axis=1)
            for vector in (slopes.by_end, slopes.by_area)
        )
        gradient = pairs.points.gradient(positions, by_end, by_facing)
        gradient += mesh.targets.gradient(positions, by_start, by_area)
        # From the LED to the walls, dB . W, with the response at the lit points, and the finer direct response.
        emission, response = self._emission, self.response[self._seen]
        at_lit = [emission.at(lit, response) + self._direct.correction(lit) for lit in (emission.inside, emission.edge)]
        gradient[: len(self._walls.seen)] += emission.gradient(*at_lit) + self._direct.gradient(wider)
        self._gradients[wider] = gradient
        return gradient

    def bent(self, velocity: np.ndarray, side: int) -> np.ndarray:
        """Derivatives of the reading due to light between points of one plane wall, which :meth:`gradient` leaves out.

        The points see each other once the plane bends inwards, and not if it bends outwards, so that the derivatives on
        both sides differ.

        Parameters
        ----------
        velocity : (F, 15, 3) ndarray
            Velocity of the patches, in mm per unit of the parameter.
        side : int
            1 for the derivative when walls leave the plane along the velocity, -1 for the derivative when they arrive
            at it.

        Returns
        -------
        (F,) ndarray
            Derivatives in W per W and unit of the parameter, for each patch that the light leaves.
        """
        pairs, own, positions = self._mesh.pairs, self._mesh.own, self._walls.positions
        fastest = np.abs(velocity).max()
        if not (fastest > 0 and self._in_plane.any()):
            return np.zeros(len(positions))
        target, point = pairs.target[self._in_plane], pairs.point[self._in_plane]
        response = (self._mesh.interpolation @ self.response)[point]
        weight = pairs.weight[self._in_plane] * self._adjoint[target] * response
        step = side * BEND / fastest
        displaced = positions + step * velocity
        at, area = self._mesh.targets.positions_and_areas(displaced)
        starts = replace(self._starts, at=at, normal=area / np.linalg.norm(area, axis=1, keepdims=True))
        box, can_block = self._blocking(self._box)
        can_block = None if can_block is None else can_block[self._in_plane]
        light = Exchange(starts, *pairs.points.positions_and_areas(displaced), target, point, box, can_block)
        return np.bincount(own[target], weight * light.values() / step, len(positions))

    @cached_property
    def _in_plane(self) -> np.ndarray:
        """Mask (N,): whether both points of each pair lie in one plane, so that they see each other as soon as it bends
        inwards."""
        return self._between_walls(None).in_plane()

    def change(self, led: End, phototransistor: End, box: Box | None, scattered: np.ndarray) -> float:
        """First-order change of the reading when parts of the scene change.

        Parameters
        ----------
        led, phototransistor : End
            LED and phototransistor with their changed values.
        box : Box or None
            Box with its changed values.
        scattered : (F,) ndarray
            Changed scattering of each patch, relative to the present scattering.

        Returns
        -------
        float
            Change in W per W of the LED.
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
            exchange = self._exchange_of(self._between_walls(box))
            change += self._adjoint @ ((exchange - self._exchange) @ self.response)
        change += self._direct.by_patch() @ (scattered[: len(self._walls.seen)] - 1)
        return float(change + self._adjoint @ ((scattered[self._mesh.own] - 1) * self.response))
