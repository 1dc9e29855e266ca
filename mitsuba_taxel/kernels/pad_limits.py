"""How finely the surface of a pad's cells may be cut."""

from __future__ import annotations

from mitsuba_taxel.base.errors import InputError

MOST_TRIANGLES = 20_000_000
LEAST_FACES = 15
"""Of the finite elements on the surface of a cell, however large they may be."""


def check_triangles(subdivision: int, faces: int) -> None:
    """Refuse a subdivision of so many faces of cells that it takes too many triangles; raises `InputError`."""
    triangles = faces * subdivision**2
    if triangles > MOST_TRIANGLES:
        raise InputError(
            f"subdivision = {subdivision} is not allowed: the surface of the cells would have {triangles:.1e} "
            f"triangles, more than {MOST_TRIANGLES:.0e}; choose less, or name the cells that are read."
        )
