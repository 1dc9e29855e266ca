"""Contact model: readings of a pad from depth maps of bodies of any shape that press on its top, for many pads in one
call.

The top is divided into patches. The compliance matrix of the patches gives the contact forces (`contact_pressures`).
The change of each reading is the product of these forces with the gradient of the reading. Matrix and gradients are
those of the pad at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import floats_of, shape_words
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_pressures import contact_forces

NOT_A_NUMBER, TOO_DEEP, TOO_FAR, NOT_RESOLVED, NOT_SOLVED, PULLS, UNLIKE = 1, 2, 4, 8, 16, 32, 64
"""Bits of the status of a touch: a depth or a force that is not a number, or is infinite; a depth beyond the largest of
the model; a centre of pressure beyond its places; contact of few patches, unless it is light; contact that was not
solved; a force that pulls on the pad; contact unlike that of the bodies from which second-order terms were learnt."""
FEW_PATCHES, LIGHT = 4, 0.25
"""Number of patches below which contact is not resolved, and fraction of the largest depth up to which such a touch is
light: its forces are wrong by a fifth and more, but small."""
BEYOND = 1.1
"""Ratio of a feature of contact to the largest of the learnt bodies, above which contact is unlike theirs."""


class ContactReadings(NamedTuple):
    """Results of a contact model for B depth maps and T taxels.

    Attributes
    ----------
    power : (B, T) ndarray
        Readings in W.
    force : (B, 3) ndarray
        Force of the bodies on the pad in N; compression is z < 0. Its tangential part is that of their slope alone,
        without friction.
    moment : (B, 3) ndarray
        Moment of this force in N mm, about the centre of the pad's bottom.
    centre : (B, 2) ndarray
        Centre of pressure, x and y in mm; NaN without contact.
    area : (B,) ndarray
        Area in mm² of the patches in contact.
    pressure : (B, R, C) ndarray
        Mean contact pressure of each patch in MPa.
    status : (B,) ndarray of int
        0 if the contact is within the range of the model; otherwise the sum of the codes that apply: `NOT_A_NUMBER` 1,
        `TOO_DEEP` 2, `TOO_FAR` 4, `NOT_RESOLVED` 8, `NOT_SOLVED` 16, for given forces `PULLS` 32, and with second-order
        terms `UNLIKE` 64: depth, area or distance of the forces is beyond `BEYOND` times `SecondOrder.largest`, or the
        factor of the forces is not above 0. With 1 or 16, the other results are NaN; else they are extrapolated, or
        inaccurate.
    """

    power: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    centre: np.ndarray
    area: np.ndarray
    pressure: np.ndarray
    status: np.ndarray

    @property
    def inside(self) -> np.ndarray:
        """Mask (B,) of the contacts that are within the range of the model."""
        return self.status == 0


class SecondOrder(NamedTuple):
    """Second-order terms of a contact model: factors by which forces and changes of readings differ from the linear
    model; see `second_order`.

    Attributes
    ----------
    reading : (T, 4) ndarray
        Coefficients of 1, the relative change of the reading, the greatest depth over the height of the pad, and the
        force times the mean compliance over this height.
    force : (4,) ndarray
        Coefficients of 1, the greatest depth and the square root of the area of contact over the height of the pad, and
        this depth times the mean square distance of the forces from the middle of the top, over the cube of the height.
    largest : (4,) ndarray
        Largest values of these features in the fit.
    side : float
        Ratio of the tangential force to that of the slope of the bodies.
    """

    reading: np.ndarray
    force: np.ndarray
    largest: np.ndarray
    side: float = 1.0


class LearntErrors(NamedTuple):
    """Errors of a contact model, estimated on bodies that were solved in full and left out of its fit.

    Attributes
    ----------
    bodies, states : int
        Number of bodies, and of their states.
    reading_rms, reading_worst : float
        Error of the readings, relative to the largest change of the taxel: root mean square for the worst taxel, and
        the largest of all.
    force_rms, force_worst : float
        Error of the force vector, relative to the largest force. Its tangential part is that of the body's slope.
    moment_rms : float
        Error of the moments about x and y in N mm.
    force_full_scale : float
        Largest normal force of the states in N.
    """

    bodies: int
    states: int
    reading_rms: float
    reading_worst: float
    force_rms: float
    force_worst: float
    moment_rms: float
    force_full_scale: float


@dataclass(frozen=True, eq=False)
class ContactModel(Displayed):
    """Contact model of a pad: readings under bodies that press on its top, from depth maps of the bodies.

    A call of the model leaves out friction; :class:`FrictionPads` adds it for models with tangential compliance.

    Attributes
    ----------
    x : (C,) ndarray
        Centres of the columns of patches in mm, ascending.
    y : (R,) ndarray
        Centres of the rows in mm, descending.
    size : (float, float)
        Size of a patch along x and y in mm.
    height : float
        Height of the undeformed top above the board in mm.
    covered : (R, C) ndarray of bool
        Patches that lie on the top: M in all.
    compliance : (M, M) ndarray
        Mean normal displacement in mm of each patch (rows) per N on each patch (columns).
    rest : (T,) ndarray
        Readings at rest in W.
    gradient : (T, M) ndarray
        Change of the readings in W per N on each patch.
    largest_depth : float
        Largest depth, in mm, for which the model is used.
    places : (2, 2) ndarray
        Range of the centre of pressure for which the model is used, in mm: lowest x and y, then highest x and y.
    second : NamedTuple or None
        Second-order terms, a `SecondOrder`; None for a linear model.
    errors : NamedTuple or None
        Errors on bodies that were left out, `LearntErrors`; None for a linear model, whose error is not known.
    lateral : (2, M, M) ndarray or None
        Mean displacement of each patch along x and y in mm, per N on each; None if it is not known.
    tangential : (2, M, 2, M) ndarray or None
        Mean displacement of each patch along x and y in mm, per N along x and y on each; None for a model without
        friction.
    tangential_gradient : (T, 2, M) ndarray or None
        Change of the readings in W per N along x and y on each patch; None for a model without friction.
    """

    x: np.ndarray
    y: np.ndarray
    size: tuple[float, float]
    height: float
    covered: np.ndarray
    compliance: np.ndarray
    rest: np.ndarray
    gradient: np.ndarray
    largest_depth: float
    places: np.ndarray
    second: SecondOrder | None = None
    errors: LearntErrors | None = None
    lateral: np.ndarray | None = None
    tangential: np.ndarray | None = None
    tangential_gradient: np.ndarray | None = None

    @property
    def points(self) -> np.ndarray:
        """Points (rows, columns, 3) in mm, in the frame of the pad, at which a depth map states depths: the centres of
        the patches."""
        x, y = np.meshgrid(self.x, self.y)
        return np.stack([x, y, np.full_like(x, self.height)], axis=-1)

    def __call__(self, depth: np.ndarray) -> ContactReadings:
        """Compute readings and forces from depth maps.

        Parameters
        ----------
        depth : (B, rows, columns) or (rows, columns) ndarray
            Depth of the body's surface below the undeformed top at each of `points`, in mm, in B maps, one for each
            pad. It is 0 or negative where there is no body.

        Returns
        -------
        ContactReadings
            Results; B is 1 for a single map.

        Raises
        ------
        InputError
            if the map has another grid.
        """
        # Forces on the patches.
        depth = self._checked(depth)
        finite = np.isfinite(depth).all(axis=(1, 2))
        depth = np.where(finite[:, None, None], depth, np.nan)
        deepest = depth.max(axis=(1, 2))
        forces = contact_forces(self.compliance, self._means(depth)[:, self.covered])
        forces[~finite] = np.nan
        solved = np.isfinite(forces).all(axis=1)

        readings = self._readings(forces, deepest, depth)
        few = np.count_nonzero(forces > 0, axis=1)
        few = (few > 0) & (few < FEW_PATCHES) & (deepest > LIGHT * self.largest_depth)
        flags = {NOT_A_NUMBER: ~finite, NOT_RESOLVED: few, NOT_SOLVED: finite & ~solved}
        return readings._replace(status=readings.status + _bits(flags))

    def from_forces(self, force: np.ndarray) -> ContactReadings:
        """Compute readings from maps of known contact forces, such as those of a physics engine.

        Parameters
        ----------
        force : (B, rows, columns) or (rows, columns) ndarray
            Normal force of the bodies on each patch in N, above 0 for compression: B maps, of one pad each. Forces
            beside the top, where `covered` is false, must be 0. `force_maps` makes them from lists of contacts.

        Returns
        -------
        ContactReadings
            Results; the area is that of all patches with a force. B is 1 for a single map.

        Raises
        ------
        InputError
            if the map has another grid, or a force beside the top.
        """
        force = self._checked(force, "force")
        if np.any(np.nan_to_num(force[:, ~self.covered])):
            raise InputError("force beside the top of the pad is not allowed: it must be 0 where covered is false.")
        finite = np.isfinite(force).all(axis=(1, 2))
        forces = np.where(finite[:, None], force[:, self.covered], np.nan)
        deepest = (forces @ self.compliance).max(axis=1)
        if self.second is not None:
            # Forces of the linear model, of which these are a multiple, which is the root of a quadratic equation.
            features = self.force_features(forces, deepest)
            by_depth = features[:, [1, 3]] @ self.second.force[[1, 3]]
            half = 0.5 * (1 + features @ self.second.force - by_depth)
            square = half**2 + by_depth
            ratio = half + np.sqrt(np.where(square >= 0, square, np.nan))
            ratio = np.where(ratio > 0, ratio, np.nan)
            forces, deepest = forces / ratio[:, None], deepest / ratio
        readings = self._readings(forces, deepest)
        pulls = (forces < 0).any(axis=1)
        flags = {NOT_A_NUMBER: ~finite, NOT_SOLVED: finite & np.isnan(deepest), PULLS: pulls}
        return readings._replace(status=readings.status + _bits(flags))

    def displacement(self, depth: np.ndarray) -> np.ndarray:
        """Displacement of the top under bodies, to first order; for example, of markers on the top.

        Parameters
        ----------
        depth : (B, rows, columns) or (rows, columns) ndarray
            Maps of depth as for a call of the model.

        Returns
        -------
        (B, rows, columns, 3) ndarray
            Mean displacement of each patch in mm; NaN beside the top, and where a depth is not a number.

        Raises
        ------
        InputError
            if the map has another grid, or the model has no lateral displacements.
        """
        if self.lateral is None:
            raise InputError("this model has no lateral displacements: export it again.")
        depth = self._checked(depth)
        forces = contact_forces(self.compliance, self._means(depth)[:, self.covered])
        forces[~np.isfinite(depth).all(axis=(1, 2))] = np.nan
        moved = np.full((*depth.shape, 3), np.nan)
        moved[:, self.covered] = np.stack([*(forces @ self.lateral.transpose(0, 2, 1)), -forces @ self.compliance], -1)
        return moved

    def force_features(self, forces: np.ndarray, deepest: np.ndarray) -> np.ndarray:
        """Features of a contact, from which the second-order terms compute the deviation of the force from the linear
        model.

        Parameters
        ----------
        forces : (B, M) ndarray
            Forces of the linear model in N, or any multiple.
        deepest : (B,) ndarray
            Greatest depths in mm.

        Returns
        -------
        (B, 4) ndarray
            Features, in the order of `SecondOrder.force`.
        """
        points = self.points[self.covered][:, :2] - [self.x.mean(), self.y.mean()]
        total = forces.sum(axis=1)
        squares = forces @ (points**2).sum(axis=1)
        apart = np.divide(squares, total, out=np.zeros_like(total), where=total != 0) / self.height**2
        wide = np.sqrt(self.size[0] * self.size[1] * np.count_nonzero(forces > 0, axis=1)) / self.height
        deep = np.maximum(deepest, 0.0) / self.height
        return np.stack([np.ones_like(total), deep, wide, deep * apart], axis=1)

    def reading_features(self, change: np.ndarray, total: np.ndarray, deepest: np.ndarray) -> np.ndarray:
        """Features of a contact, from which the second-order terms compute the deviation of the readings from the
        linear model.

        Parameters
        ----------
        change : (B, T) ndarray
            Linear changes in W.
        total : (B,) ndarray
            Normal forces in N.
        deepest : (B,) ndarray
            Greatest depths in mm.

        Returns
        -------
        (B, T, 4) ndarray
            Features, in the order of `SecondOrder.reading`.
        """
        deep, strain = np.maximum(deepest, 0.0) / self.height, total * self.compliance.mean() / self.height
        columns = [np.ones(change.shape), change / self.rest, deep[:, None], strain[:, None]]
        return np.stack(np.broadcast_arrays(*columns), axis=2)

    def _readings(self, forces: np.ndarray, deepest: np.ndarray, depth: np.ndarray | None = None) -> ContactReadings:
        """Results for forces (B, M) of the linear model in N and greatest depths (B,) in mm, with the flags of both.
        The depth maps ``depth`` (B, rows, columns), if they are known, give the directions of the forces.
        """
        patches, area = np.count_nonzero(forces > 0, axis=1), self.size[0] * self.size[1]
        unlike = np.zeros(len(forces), dtype=bool)
        if self.second is not None:
            # Second-order terms; all forces of a touch change in proportion.
            features = self.force_features(forces, deepest)
            ratio = 1 + features @ self.second.force
            unlike = (patches > 0) & ((features > BEYOND * self.second.largest).any(axis=1) | (ratio <= 0))
            forces = forces * ratio[:, None]

        # Their sum, and their moments about the x and y axes.
        points = self.points[self.covered][:, :2]
        total, about = forces.sum(axis=1), forces @ points
        centre = about / np.where(total > 0, total, np.nan)[:, None]
        change = forces @ self.gradient.T
        if self.second is not None:
            features = self.reading_features(change, total, deepest)
            change = change * (1 + (features * self.second.reading).sum(axis=2))
        zero = 0 * total  # NaN where that is
        pressure = np.zeros((len(forces), *self.covered.shape)) + zero[:, None, None]
        pressure[:, self.covered] = forces / area
        # Without friction, a body presses along its normal, at the height of its surface.
        sideways, lever, turn = np.stack([zero, zero]), np.stack([zero, zero]), zero
        if depth is not None:
            side = 1.0 if self.second is None else self.second.side
            tangential = -side * forces * self.slopes(depth)[..., self.covered]
            heights = self.height - np.maximum(depth[:, self.covered], 0.0)
            sideways, lever = tangential.sum(axis=2), (tangential * heights).sum(axis=2)
            turn = tangential[1] @ points[:, 0] - tangential[0] @ points[:, 1]
        far = (centre < self.places[0]) | (centre > self.places[1])
        return ContactReadings(
            power=self.rest + change,
            force=np.stack([*sideways, -total], axis=1),
            moment=np.stack([-about[:, 1] - lever[1], about[:, 0] + lever[0], turn], axis=1),
            centre=centre,
            area=area * patches + zero,
            pressure=pressure,
            status=_bits({TOO_DEEP: deepest > self.largest_depth, TOO_FAR: far.any(axis=1), UNLIKE: unlike}),
        )

    def _checked(self, values: np.ndarray, name: str = "depth") -> np.ndarray:
        """Convert maps to an array (B, rows, columns); raises `InputError` if that is not possible."""
        maps = floats_of(values)
        maps = maps[None] if maps.ndim == 2 else maps
        if maps.ndim != 3 or maps.shape[1:] != self.covered.shape:
            rows, columns = self.covered.shape
            raise InputError(
                f"{name} {shape_words(values)} is not allowed: maps of {rows} rows and {columns} columns are "
                "needed, at the points of the model."
            )
        return maps

    def _means(self, depth: np.ndarray) -> np.ndarray:
        """Mean depth over each patch, from the depths at the centres of the patches. Its second-order correction, 1/24
        of the second differences along x and y, is added where both neighbours lie below the body.
        """
        means = depth.copy()
        for axis in (1, 2):
            if depth.shape[axis] < 3:
                continue
            maps, into = np.moveaxis(depth, axis, -1), np.moveaxis(means, axis, -1)
            before, own, after = maps[..., :-2], maps[..., 1:-1], maps[..., 2:]
            below = (before > 0) & (own > 0) & (after > 0)
            into[..., 1:-1] += np.where(below, (before - 2 * own + after) / 24, 0.0)
        return means

    def slopes(self, depth: np.ndarray) -> np.ndarray:
        """Slopes of bodies along x and y, from patches below the body: means of those to both neighbours, and at an
        edge that to one, extrapolated from the next.

        Parameters
        ----------
        depth : (B, rows, columns) ndarray
            Maps of depth in mm.

        Returns
        -------
        (2, B, rows, columns) ndarray
            Slopes of depth along x and y; 0 beside the body.
        """
        slopes = []
        for axis, step in ((2, self.size[0]), (1, -self.size[1])):
            maps, width = np.moveaxis(depth, axis, -1), [(0, 0), (0, 0), (2, 2)]
            both = (maps[..., 1:] > 0) & (maps[..., :-1] > 0)
            rise, known = np.pad(np.where(both, np.diff(maps, axis=-1) / step, 0.0), width), np.pad(both, width)
            before, after = rise[..., 1:-2], rise[..., 2:-1]
            first = np.where(known[..., 3:], 1.5 * after - 0.5 * rise[..., 3:], after)
            last = np.where(known[..., :-3], 1.5 * before - 0.5 * rise[..., :-3], before)
            is_first, is_last = ~known[..., 1:-2], ~known[..., 2:-1]
            slope = np.where(is_first, np.where(is_last, 0.0, first), np.where(is_last, last, 0.5 * (before + after)))
            slopes.append(np.moveaxis(slope, -1, axis))
        return np.stack(slopes)


def _bits(flags: dict[int, np.ndarray]) -> np.ndarray:
    """Combine flags to one number per pad (B,): the sum of the codes whose flag is true."""
    return np.asarray(sum(np.where(flag, bit, 0) for bit, flag in flags.items()))
