"""Friction between bodies and the linear elastic top of pads, by the compliance of the top along x and y.

On each patch, the tangential force t of a body is at most the coefficient of friction times the normal force (Coulomb).
Where it is less, the patch moves with the body: it sticks. Where it is equal, the body slides over the patch along t.
For given normal forces, t minimises t K t / 2 - t u, with the tangential compliance K and the displacement u that a
stuck top would have (J. J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990, chapter 4). The problem
is convex, and is solved by the alternating direction method of multipliers of `contact_iteration`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import floats_of, is_number, is_whole, refusal, require, shape_words
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_iteration import RELAXATION
from mitsuba_taxel.surrogates.contact_readings import NOT_A_NUMBER, NOT_SOLVED, ContactModel, ContactReadings

TOLERANCE = 1e-9
"""Residual at which the iteration ends, relative to the largest limit of the friction of each pad."""
MOST_ITERATIONS = 3000
EXCHANGES = 3
"""Number of times that normal and tangential forces are computed in a step, one from the other."""
SLIDES = 1e-6
"""A patch slides where its force is less than this fraction below the limit of friction."""


class FrictionReadings(NamedTuple):
    """Results of pads with friction.

    Attributes
    ----------
    readings : ContactReadings
        Results with friction. The centre of pressure and the moments are at the displaced places of the patches, and
        pressures are those of the undeformed ones.
    traction : (B, 2, R, C) ndarray
        Mean tangential traction of the bodies on each patch along x and y in MPa.
    sliding : (B, R, C) ndarray of bool
        Patches over which a body slides.
    """

    readings: ContactReadings
    traction: np.ndarray
    sliding: np.ndarray


class FrictionPads:
    """B pads on which bodies stick and slide, step by step.

    Tangential forces displace the top along x and y alone; this is exact for an incompressible half-space (K. L.
    Johnson, Contact Mechanics, 1985, chapter 7). Where the top is dragged along, it meets another part of the body,
    which the slopes of the map of depth tell. Tangential forces act linearly on the readings. Each step goes on from
    the sticking and sliding of the one before, so that paths back and forth have their hysteresis.

    Parameters
    ----------
    model : ContactModel
        A contact model with tangential compliance: ``contact_model(..., friction=True)``.
    pads : int
        Number B of pads.
    friction : float
        Coefficient of Coulomb's friction.

    Raises
    ------
    InputError
        if a value is not allowed, or the model has no tangential compliance.
    """

    def __init__(self, model: ContactModel, pads: int, friction: float) -> None:
        require("model", model, ContactModel, "a ContactModel")
        if not (is_whole(pads) and pads > 0):
            raise refusal("pads", pads, "a whole number above 0 is needed")
        if not (is_number(friction) and friction >= 0):
            raise refusal("friction", friction, "a finite number of at least 0 is needed")
        if model.tangential is None or model.tangential_gradient is None or model.lateral is None:
            raise InputError("this model has no friction: make it by contact_model or export_contact, friction=True.")
        self._model, self._friction, self._lateral = model, float(friction), model.lateral
        self._gradient, patches = model.tangential_gradient, len(model.compliance)
        self._compliance = model.tangential.reshape(2 * patches, 2 * patches)
        least, largest = np.linalg.eigvalsh(self._compliance)[[0, -1]]
        if least <= 0:
            raise InputError("the tangential compliance of the patches is singular: a larger spacing is needed.")
        self._penalty = float(np.sqrt(least * largest))
        self._operator = np.linalg.inv(self._compliance + self._penalty * np.eye(2 * patches))
        # Displacements of the patches at the end of the last step: all of them, and those by tangential forces alone.
        self._moved, self._dragged = np.zeros((2, pads, 2, patches))

    def step(self, depth: np.ndarray, slip: np.ndarray) -> FrictionReadings:
        """Results after a step, in which bodies move along the top.

        Parameters
        ----------
        depth : (B, rows, columns) ndarray
            Maps of depth at the end of the step, as for a call of the model; beside the contact, true heights of the
            body above the top, as negative depths, are more accurate than other numbers below 0.
        slip : (B, 2) or (B, 2, rows, columns) ndarray
            Displacement of the body in the step, along x and y in mm, relative to the undeformed pad: one for each pad,
            or one at each patch. A pad with a NaN is left as it was.

        Returns
        -------
        FrictionReadings
            Results; NaN and flagged for pads with a NaN.

        Raises
        ------
        InputError
            if an array has another shape.
        """
        model, covered, sliding = self._model, self._model.covered, floats_of(slip)
        maps = floats_of(depth)
        shape = len(self._moved), 2
        if maps.shape != (shape[0], *covered.shape):
            raise InputError(
                f"depth {shape_words(depth)} is not allowed: an array {(shape[0], *covered.shape)} is needed, with as "
                "many maps of depth as pads."
            )
        if sliding.shape not in (shape, (*shape, *covered.shape)):
            raise InputError(
                f"slip {shape_words(slip)} is not allowed: an array {shape} or {(*shape, *covered.shape)} is needed."
            )
        by_patch = sliding[..., None] if sliding.ndim == 2 else sliding[..., covered]
        known = np.isfinite(by_patch).all(axis=(1, 2))
        by_patch = np.where(known[:, None, None], by_patch, 0.0)
        slopes, bends = self._shape(np.nan_to_num(maps))
        deepest = maps.max(axis=(1, 2))[:, None]

        # A patch that the body drags along meets the part of the body above its displaced place: forces and places
        # depend on each other.
        dragged = self._dragged
        for _ in range(EXCHANGES):
            along = dragged.transpose(1, 0, 2)
            halfway = slopes + 0.5 * (bends * along).sum(axis=1)
            shifted = maps.copy()
            shifted[:, covered] = np.minimum(maps[:, covered] + (halfway * along).sum(axis=0), deepest)
            readings = model(shifted)
            normal = readings.pressure[:, covered] * np.prod(model.size)
            usable = known & np.isfinite(normal).all(axis=1)
            normal = np.where(usable[:, None], normal, 0.0)
            limit = self._friction * normal
            # The displacement of the top if all of it stuck, without that by normal forces.
            pressed = np.stack([normal @ matrix.T for matrix in self._lateral], axis=1)
            forces, solved = self._forces(self._moved + by_patch - pressed, limit)
            dragged = (forces.reshape(shape[0], -1) @ self._compliance).reshape(forces.shape)
        usable &= solved
        self._moved = np.where(usable[:, None, None], dragged + pressed, self._moved)
        self._dragged = np.where(usable[:, None, None], dragged, self._dragged)

        # Readings and wrench with the tangential forces, at the height of the body's surface and the displaced places.
        forces, dragged = (np.where(usable[:, None, None], values, np.nan) for values in (forces, dragged))
        change = np.einsum("tam,bam->bt", self._gradient, forces)
        along_x, along_y = forces.transpose(1, 0, 2)
        height, places = model.height - np.maximum(shifted[:, covered], 0.0), model.points[covered][:, :2].T + dragged
        moved = (dragged * normal[:, None]).sum(axis=2)
        turn = (places[:, 0] * along_y - places[:, 1] * along_x).sum(axis=1)
        force = np.stack([along_x.sum(axis=1), along_y.sum(axis=1), 0 * turn], axis=1)
        moment = np.stack(
            [-(height * along_y).sum(axis=1) - moved[:, 1], (height * along_x).sum(axis=1) + moved[:, 0], turn], axis=1
        )
        total = normal.sum(axis=1)[:, None]
        centre = readings.centre + moved / np.where(total > 0, total, np.nan)
        bad = np.where(known | (readings.status & NOT_A_NUMBER > 0), 0, NOT_A_NUMBER)
        bad = bad + np.where(solved | (readings.status & NOT_SOLVED > 0), 0, NOT_SOLVED)
        traction = np.full((shape[0], 2, *covered.shape), np.nan)
        traction[..., covered] = forces / np.prod(model.size)
        slides = np.zeros((shape[0], *covered.shape), dtype=bool)
        slides[:, covered] = (normal > 0) & (np.hypot(along_x, along_y) >= (1 - SLIDES) * limit)
        with_friction = readings._replace(
            power=readings.power + change,
            force=readings.force + force,
            moment=readings.moment + moment,
            centre=centre,
            area=np.where(usable, readings.area, np.nan),
            pressure=np.where(usable[:, None, None], readings.pressure, np.nan),
            status=readings.status + bad,
        )
        return FrictionReadings(with_friction, traction, slides)

    def reset(self, pads: Any = slice(None)) -> None:
        """Set pads to rest, without contact.

        Parameters
        ----------
        pads : int, slice or array_like, optional
            Indices of the pads, or a mask; by default all.
        """
        pads = pads if isinstance(pads, slice) else np.asarray(pads)
        self._moved[pads] = self._dragged[pads] = 0.0

    def _shape(self, maps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes (2, B, M) of the bodies along x and y at each patch, and the derivatives (2, 2, B, M) of each slope
        along x and y in 1/mm, from maps of depth. A depth of exactly 0 is where an engine knows no body."""
        lowest = self._model.largest_depth
        known = (maps > -lowest) & (maps != 0)
        slopes = _beside(self._model.slopes(np.where(known, maps + lowest, -1.0)), known)
        width, depth = self._model.size
        bends = [
            np.stack([np.gradient(slope, width, axis=2), -np.gradient(slope, depth, axis=1)])
            if min(slope.shape[1:]) > 1
            else np.zeros((2, *slope.shape))
            for slope in slopes
        ]
        covered = self._model.covered
        return slopes[..., covered], np.stack(bends)[..., covered]

    def _forces(self, stuck: np.ndarray, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tangential forces (B, 2, M) in N from displacements (B, 2, M) of a stuck top in mm and the limits (B, M) of
        friction in N; and whether each pad is solved."""
        shape, penalty = stuck.shape, self._penalty
        target, scale = stuck.reshape(len(stuck), -1), limit.max(axis=1)
        forces, dual = np.zeros_like(target), np.zeros_like(target)
        residual = np.where(scale > 0, np.inf, 0.0)
        for _ in range(MOST_ITERATIONS):
            left = np.flatnonzero(residual > TOLERANCE * scale)
            if not len(left):
                break
            free = (target[left] + penalty * (forces[left] - dual[left])) @ self._operator
            total = RELAXATION * free + (1 - RELAXATION) * forces[left] + dual[left]
            pairs = total.reshape(len(left), *shape[1:])
            length = np.maximum(np.hypot(pairs[:, 0], pairs[:, 1]), np.finfo(float).tiny)
            within = (pairs * np.minimum(1.0, limit[left] / length)[:, None]).reshape(total.shape)
            residual[left] = np.maximum(np.abs(free - within), np.abs(within - forces[left])).max(axis=1)
            forces[left], dual[left] = within, total - within
        return forces.reshape(shape), residual <= TOLERANCE * scale


def _beside(slopes: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Slopes (2, B, rows, columns) of maps that are known where bodies are below the top, ``below``, with means of
    neighbours at patches beside them."""
    width = [(0, 0), (0, 0), (1, 1), (1, 1)]
    known = np.pad(below.astype(float), width[1:])
    values = np.pad(np.where(below, slopes, 0.0), width)

    def neighbours(array: np.ndarray) -> np.ndarray:
        across = array[..., 1:-1, :-2] + array[..., 1:-1, 2:]
        return across + array[..., :-2, 1:-1] + array[..., 2:, 1:-1]

    return np.where(below, slopes, neighbours(values) / np.maximum(neighbours(known), 1.0))
