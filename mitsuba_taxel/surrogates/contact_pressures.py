"""Contact forces between rigid bodies and a linear elastic top, without friction, for many bodies at once.

The top is divided into patches with the compliance matrix C. Forces f on the patches displace them by C f. A body at
the depth d requires f >= 0 and C f >= d, with C f = d where f > 0: a linear complementarity problem. It is solved by
block principal pivoting, which terminates for positive definite C (J. J. Judice and F. M. Pires, Computers Oper. Res.
21, 1994), here for batches.
"""

from __future__ import annotations

import numpy as np

PATIENCE = 3
"""Number of consecutive exchanges of all violated patches without progress, after which only the last one is
exchanged."""
MOST_EXCHANGES = 300
ROUNDING = 1e-12
"""Forces and gaps below 0 by less than this fraction of the largest are rounding errors."""
MOST_ENTRIES = 2_000_000
"""Largest number of entries of the matrices that are solved in one batch, 16 MB."""


def contact_forces(compliance: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Contact forces on the patches of a pad's top under several bodies, from the depth of each body at each patch.

    Only patches with a depth above 0 can be in contact.

    Parameters
    ----------
    compliance : (m, m) ndarray
        Symmetric positive definite matrix of the displacements of m patches in mm, per N on each.
    depth : (B, m) ndarray
        Depths in mm of B bodies below the undeformed top, at each patch; 0 or less where there is none.

    Returns
    -------
    (B, m) ndarray
        Forces in N, 0 without contact; NaN in a row that has a NaN or was not solved.
    """
    forces = np.zeros(depth.shape)
    finite = np.isfinite(depth).all(axis=1)
    forces[~finite] = np.nan
    reached = np.where(finite[:, None], depth > 0, False)
    counts = reached.sum(axis=1)
    rows = np.flatnonzero(counts)
    rows = rows[np.argsort(counts[rows], kind="stable")]
    while len(rows):
        # A batch has matrices of one size, that of its row with the most patches, which is the last one.
        batch = rows[: max(1, MOST_ENTRIES // int(counts[rows[-1]]) ** 2)]
        size, rows = int(counts[batch[-1]]), rows[len(batch) :]
        patches = np.argsort(~reached[batch], axis=1, kind="stable")[:, :size]
        within = np.take_along_axis(reached[batch], patches, axis=1)
        depths = np.where(within, np.take_along_axis(depth[batch], patches, axis=1), 0.0)
        solution = _pivoted(compliance[patches[:, :, None], patches[:, None, :]], depths, within)
        forces[batch[:, None], patches] = np.where(within | np.isnan(solution), solution, 0.0)
    return forces


def _pivoted(matrices: np.ndarray, depth: np.ndarray, within: np.ndarray) -> np.ndarray:
    """Solve B complementarity problems for k patches each: from matrices (B, k, k) and depths (B, k). ``within`` (B, k)
    marks the patches that exist."""
    solution = np.full(depth.shape, np.nan)
    left, active = np.arange(len(depth)), within.copy()
    fewest, patience = np.full(len(depth), depth.shape[1] + 1), np.full(len(depth), PATIENCE)
    unit = np.eye(depth.shape[1])
    for _ in range(MOST_EXCHANGES):
        # Solve for the active patches; a force that pulls, or a body that reaches into the top, is a violation.
        both = active[:, :, None] & active[:, None, :]
        forces = np.linalg.solve(np.where(both, matrices, unit), np.where(active, depth, 0.0)[..., None])[..., 0]
        gap = (matrices @ forces[..., None])[..., 0] - depth
        value = np.where(active, forces / np.abs(forces).max(axis=1, keepdims=True), gap / depth.max(axis=1)[:, None])
        violated = within & (value < -ROUNDING)
        count = violated.sum(axis=1)
        solution[left[count == 0]] = np.maximum(forces[count == 0], 0.0)

        # Exchange all violated patches while their number falls; else the last one alone, which cannot cycle.
        fewer = count < fewest
        fewest, patience = np.where(fewer, count, fewest), np.where(fewer, PATIENCE, patience - 1)
        last = violated.shape[1] - 1 - np.argmax(violated[:, ::-1], axis=1)
        alone = violated & (np.arange(violated.shape[1]) == last[:, None])
        active = active ^ np.where((patience > 0)[:, None], violated, alone)
        open_rows = count > 0
        if not open_rows.any():
            break
        left, active, within, depth = left[open_rows], active[open_rows], within[open_rows], depth[open_rows]
        matrices, fewest, patience = matrices[open_rows], fewest[open_rows], patience[open_rows]
    return solution
