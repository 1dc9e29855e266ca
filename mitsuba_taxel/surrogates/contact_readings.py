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

from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_pressures import contact_forces

NOT_A_NUMBER, TOO_DEEP, TOO_FAR, NOT_RESOLVED, NOT_SOLVED, PULLS = 1, 2, 4, 8, 16, 32
"""Bits of the status of a touch: a depth or a force that is not a number, or is infinite; a depth beyond the largest of
the model; a centre of pressure beyond its places; contact of few patches, unless it is light; contact that was not
solved; a force that pulls on the pad."""
FEW_PATCHES, LIGHT = 4, 0.25
"""Number of patches below which contact is not resolved, and fraction of the largest depth up to which such a touch is
light: its forces are wrong by a fifth and more, but small."""


class ContactReadings(NamedTuple):
    """Results of a contact model for B depth maps and T taxels.

    Attributes
    ----------
    power : (B, T) ndarray
        Readings in W.
    force : (B, 3) ndarray
        Force of the bodies on the pad in N; compression is z < 0.
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
        `TOO_DEEP` 2, `TOO_FAR` 4, `NOT_RESOLVED` 8, `NOT_SOLVED` 16 and, for given forces, `PULLS` 32. With 1 or 16,
        the other results are NaN;
        else they are extrapolated, or inaccurate.
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
    """Coefficients of the second-order terms of a contact model, for T readings and for the force; `second_order` has
    the formulas.

    Attributes
    ----------
    reading : (T, 2) ndarray
        Coefficients of two factors of the linear change of each reading: the relative change of the reading, and the
        largest depth divided by the height of the pad.
    force : (2,) ndarray
        Coefficients of two factors of the linear force: the largest depth, and the square root of the contact area,
        both divided by the height of the pad.
    """

    reading: np.ndarray
    force: np.ndarray


class LearntErrors(NamedTuple):
    """Errors of a contact model, found on full solutions of bodies that were left out of its fit.

    Attributes
    ----------
    bodies, states : int
        Number of bodies, and of their states.
    reading_rms, reading_worst : float
        Error of the readings, relative to the largest change of the taxel: root mean square for the worst taxel, and
        the largest of all.
    force_rms, force_worst : float
        Error of the force vector, relative to the largest force. Its tangential part is not modelled.
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
    """Contact model of a pad: readings under bodies that press on its top, without friction, from depth maps of the
    bodies.

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
        Mean displacement of each patch along x and y in mm, per N on each; None in files of an earlier version.
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

    @property
    def points(self) -> np.ndarray:
        """Points (rows, columns, 3) in mm, in the frame of the pad, at which a depth map states depths: the centres of
        the patches."""
        x, y = np.meshgrid(self.x, self.y)
        return np.stack([x, y, np.full_like(x, self.height)], axis=-1)

    def __call__(self, depth: np.ndarray) -> ContactReadings:
        """Compute readings and forces from maps of depths.

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

        readings = self._readings(forces, deepest)
        few = np.count_nonzero(forces > 0, axis=1)
        few = (few > 0) & (few < FEW_PATCHES) & (deepest > LIGHT * self.largest_depth)
        flags = {NOT_A_NUMBER: ~finite, NOT_RESOLVED: few, NOT_SOLVED: finite & ~solved}
        return readings._replace(status=readings.status + _bits(flags))

    def from_forces(self, force: np.ndarray) -> ContactReadings:
        """Compute readings from maps of contact forces that are known, as physics engines give them.

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
            patches = np.count_nonzero(forces > 0, axis=1)
            deep, wide = self.second.force / self.height * np.array([1.0, np.sqrt(self.size[0] * self.size[1])])
            half = 0.5 * (1 + wide * np.sqrt(patches))
            square = half**2 + deep * np.maximum(deepest, 0.0)
            ratio = half + np.sqrt(np.where(square >= 0, square, np.nan))
            forces, deepest = forces / ratio[:, None], deepest / ratio
        readings = self._readings(forces, deepest)
        pulls = (forces < 0).any(axis=1)
        flags = {NOT_A_NUMBER: ~finite, NOT_SOLVED: finite & np.isnan(deepest), PULLS: pulls}
        return readings._replace(status=readings.status + _bits(flags))

    def displacement(self, depth: np.ndarray) -> np.ndarray:
        """Displacement of the top under bodies, to first order, as for markers on it.

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
            if the map has another grid, or the model is from a file without lateral displacements.
        """
        if self.lateral is None:
            raise InputError("this model has no lateral displacements: export it again.")
        depth = self._checked(depth)
        forces = contact_forces(self.compliance, self._means(depth)[:, self.covered])
        forces[~np.isfinite(depth).all(axis=(1, 2))] = np.nan
        moved = np.full((*depth.shape, 3), np.nan)
        moved[:, self.covered] = np.stack([*(forces @ self.lateral.transpose(0, 2, 1)), -forces @ self.compliance], -1)
        return moved

    def _readings(self, forces: np.ndarray, deepest: np.ndarray) -> ContactReadings:
        """Results for forces (B, M) of the linear model in N and greatest depths (B,) in mm, with the flags of both."""
        # Their sum, and their moments about the x and y axes.
        change = forces @ self.gradient.T
        points, area = self.points[self.covered][:, :2], self.size[0] * self.size[1]
        total, about, patches = forces.sum(axis=1), forces @ points, np.count_nonzero(forces > 0, axis=1)
        centre = about / np.where(total > 0, total, np.nan)[:, None]
        if self.second is not None:
            # Second-order terms; all forces of a touch change in proportion.
            deep = np.maximum(deepest, 0.0) / self.height
            wide = np.sqrt(area * patches) / self.height
            terms = self.second.reading
            change = change * (1 + change / self.rest * terms[:, 0] + deep[:, None] * terms[:, 1])
            ratio = 1 + np.stack([deep, wide], axis=1) @ self.second.force
            forces, total, about = forces * ratio[:, None], total * ratio, about * ratio[:, None]
        zero = 0 * total  # NaN where that is
        pressure = np.zeros((len(forces), *self.covered.shape)) + zero[:, None, None]
        pressure[:, self.covered] = forces / area
        far = (centre < self.places[0]) | (centre > self.places[1])
        return ContactReadings(
            power=self.rest + change,
            force=np.stack([zero, zero, -total], axis=1),
            moment=np.stack([-about[:, 1], about[:, 0], zero], axis=1),
            centre=centre,
            area=area * patches + zero,
            pressure=pressure,
            status=_bits({TOO_DEEP: deepest > self.largest_depth, TOO_FAR: far.any(axis=1)}),
        )

    def _checked(self, values: np.ndarray, name: str = "depth") -> np.ndarray:
        """Convert maps to an array (B, rows, columns); raises `InputError` if that is not possible."""
        try:
            maps = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            maps = np.zeros(0)
        maps = maps[None] if maps.ndim == 2 else maps
        if maps.ndim != 3 or maps.shape[1:] != self.covered.shape:
            rows, columns = self.covered.shape
            raise InputError(
                f"{name} of shape {np.shape(values)} is not allowed: maps of {rows} rows and {columns} columns are "
                "needed, at the points of the model."
            )
        return maps

    def _means(self, depth: np.ndarray) -> np.ndarray:
        """Mean depth over each patch, from the depths at the centres of the patches. A 24th of the second differences
        along x and y is added where both neighbours lie below the body."""
        means = depth.copy()
        for axis in (1, 2):
            if depth.shape[axis] < 3:
                continue
            maps, into = np.moveaxis(depth, axis, -1), np.moveaxis(means, axis, -1)
            before, own, after = maps[..., :-2], maps[..., 1:-1], maps[..., 2:]
            below = (before > 0) & (own > 0) & (after > 0)
            into[..., 1:-1] += np.where(below, (before - 2 * own + after) / 24, 0.0)
        return means


def _bits(flags: dict[int, np.ndarray]) -> np.ndarray:
    """Sum (B,) of the bits whose flag (B,) is true."""
    return np.asarray(sum(np.where(flag, bit, 0) for bit, flag in flags.items()))
