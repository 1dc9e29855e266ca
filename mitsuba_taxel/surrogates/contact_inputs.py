"""Depth maps and force maps for a contact model, from the lists of contacts that physics engines provide."""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import floats_of, refusal, require, shape_of, shape_words
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_readings import ContactModel

UNIT = 1e-3
"""Largest difference of the length of a normal from 1."""
NOWHERE = -1.0
"""Depth in mm where there is no body."""


def depth_maps(
    model: ContactModel,
    points: np.ndarray,
    depths: np.ndarray,
    radius: float | np.ndarray,
    *,
    normals: np.ndarray | None = None,
    pad: np.ndarray | None = None,
    pads: int = 1,
) -> np.ndarray:
    """Depth maps for a contact model, from a list of contacts between bodies and pads.

    At each contact the body is taken as a ball with the radius of the contact, which is exact for balls. If a pad has
    several contacts, the map contains the greatest depth at each patch. All lengths are in the frame of the pad.

    Parameters
    ----------
    model : ContactModel
        The model.
    points : (K, 3) array_like
        Places of the contacts in mm, midway between the surfaces of body and pad, as MuJoCo gives them.
    depths : (K,) array_like
        Depth of penetration along the normal in mm; 0 or less for bodies that do not touch.
    radius : float or (K,) array_like
        Radius of curvature of the body at each contact in mm.
    normals : (K, 3) array_like, optional
        Unit vectors from the body into the pad; by default straight down.
    pad : (K,) array_like of int, optional
        Number of the pad of each contact, from 0; by default, all are on the first.
    pads : int
        Number of pads.

    Returns
    -------
    (pads, rows, columns) ndarray
        Depths in mm; -1 where there is no body. NaN in the map of a pad with a contact that has a NaN, or whose normal
        does not point down: it is not on the top.

    Raises
    ------
    InputError
        if shapes do not agree, a radius is not above 0, or a normal is not a unit vector.
    """
    places = _vectors("points", points)
    count = len(places)
    depth, pad = _numbers("depths", depths, count), _pads(pad, pads, count)
    radii = _numbers("radius", radius, count)
    down = np.tile([0.0, 0.0, -1.0], (count, 1)) if normals is None else _vectors("normals", normals)
    if len(down) != count:
        raise InputError(f"normals of shape {down.shape} do not belong to {count} points.")
    if not ((radii > 0) & np.isfinite(radii)).all():
        raise refusal("radius", radius, "finite lengths in mm above 0 are needed")
    known = np.isfinite(down).all(axis=1)
    if not (np.abs(np.linalg.norm(down, axis=1) - 1) < UNIT)[known].all():
        raise InputError("normals must be unit vectors, from the body into the pad.")
    depth = np.where(down[:, 2] < 0, depth, np.nan)  # not on the top

    # The deepest point of each ball lies half the depth below the place of its contact.
    centres = places + (0.5 * depth - radii)[:, None] * down
    grid = model.points
    maps = np.full((pads, *model.covered.shape), NOWHERE)
    for number, centre, own, ball in zip(pad, centres, depth, radii, strict=True):
        if np.isnan(own) or np.isnan(centre).any():
            maps[number] = np.nan
        elif own > 0:
            square = ball**2 - ((grid[..., :2] - centre[:2]) ** 2).sum(axis=-1)
            below = model.height - centre[2] + np.sqrt(np.maximum(square, 0.0))
            maps[number] = np.maximum(maps[number], np.where(square > 0, below, NOWHERE))
    return maps


def force_maps(
    model: ContactModel,
    points: np.ndarray,
    forces: np.ndarray,
    *,
    pad: np.ndarray | None = None,
    pads: int = 1,
) -> np.ndarray:
    """Maps of normal force for `ContactModel.from_forces`, from a list of contact forces on pads.

    Each force is divided between the four nearest patches, so that the sum and, away from the rim, the moments stay the
    same. Tangential components are left out. All vectors are in the frame of the pad.

    Parameters
    ----------
    model : ContactModel
        The model.
    points : (K, 3) array_like
        Places of the contacts in mm; their heights are not used.
    forces : (K, 3) array_like
        Forces of the bodies on the pad in N; compression is z < 0.
    pad : (K,) array_like of int, optional
        Number of the pad of each contact, from 0; by default, all are on the first.
    pads : int
        Number of pads.

    Returns
    -------
    (pads, rows, columns) ndarray
        Normal force on each patch in N, above 0 for compression. NaN in the map of a pad with a contact that has a
        NaN, or lies beside the top.

    Raises
    ------
    InputError
        if shapes do not agree.
    """
    places, vectors = _vectors("points", points), _vectors("forces", forces)
    if len(vectors) != len(places):
        raise InputError(f"forces of shape {vectors.shape} do not belong to {len(places)} points.")
    pad = _pads(pad, pads, len(places))
    maps = np.zeros((pads, *model.covered.shape))
    columns = (places[:, 0] - model.x[0]) / model.size[0]
    rows = (model.y[0] - places[:, 1]) / model.size[1]
    for number, row, column, force in zip(pad, rows, columns, -vectors[:, 2], strict=True):
        weights = _hats(row, len(model.y))[:, None] * _hats(column, len(model.x)) * model.covered
        total = weights.sum()
        maps[number] += force * weights / total if total > 0 else np.nan
    return maps


def _hats(place: float, count: int) -> np.ndarray:
    """Weights (count,) with which a value at a place, from 0 to count - 1, is distributed to the grid points by linear
    interpolation. They are 0 if the place lies more than half a step outside the grid.
    """
    if not -0.5 <= place <= count - 0.5:
        return np.zeros(count)
    return np.maximum(1 - np.abs(np.arange(count) - np.clip(place, 0, count - 1)), 0.0)


def _vectors(name: str, values: Any) -> np.ndarray:
    """Convert values to an array (K, 3), an empty list to (0, 3); raises `InputError` if that is not possible."""
    array = floats_of(values)
    array = array.reshape(0, 3) if shape_of(values) == (0,) else array
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} {shape_words(values)} is not allowed: rows of x, y, z are needed.")
    return array


def _numbers(name: str, values: Any, count: int) -> np.ndarray:
    """Convert values to an array (K,); a single number is repeated K times. Raises `InputError` if that is not
    possible.
    """
    array = floats_of(values)
    array = np.full(count, float(array)) if array.ndim == 0 else array
    if array.shape != (count,):
        raise InputError(f"{name} {shape_words(values)} is not allowed: one number for each of {count} points.")
    return array


def _pads(pad: Any, pads: int, count: int) -> np.ndarray:
    """Check the list that states, for each of K contacts, the number of its pad, and return it as an array (K,); raises
    `InputError`.
    """
    require("pads", pads, int, "a whole number")
    pad = [0] * count if pad is None else pad
    fits = pads > 0 and shape_of(pad) == (count,)
    numbers = np.asarray(pad if fits and count else [], dtype=None if fits and count else int)
    if not fits or numbers.dtype.kind not in "iu":
        raise InputError(f"pad {shape_words(pad)} is not allowed: a whole number for each of {count} points.")
    if count and not (0 <= numbers.min() and numbers.max() < pads):
        wrong = numbers[(numbers < 0) | (numbers >= pads)]
        raise refusal("pad", int(wrong[0]), f"numbers from 0 to {pads - 1} are needed")
    return numbers
