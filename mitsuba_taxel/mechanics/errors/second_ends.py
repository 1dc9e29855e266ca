"""Ends of load paths compared with those on a second mesh: an end that depends on the elements is no limit of the
sensor."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.convergence import LOCAL_ORDER
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, listed
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.equilibrium.feet import said_of
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison, size_ratio
from mitsuba_taxel.mechanics.errors.second_meshes import second_meshes

LARGEST_ERROR = 0.1
"""Largest relative error of an end that is stated. With a larger error the end is said to depend on the elements."""
LEAST_ERROR = 0.01
"""Least relative error of an end that is stated."""
NO_LIMIT = "this end depends on the elements, and is no limit of the sensor"


def end_on_second_mesh(
    path: PadPath, value: np.ndarray, obstacles: np.ndarray | None, end: LoadPathEnds
) -> LoadPathEnds:
    """Add a comparison to the message of an end: the end of the same path on a second mesh, and either an error or the
    statement that the end depends on the elements.

    The second mesh is that from which the errors of states are estimated, mostly with elements of twice the size. Its
    path is solved when the message is first read. The error is assumed to fall with the element size (L. F. Richardson,
    1911, of first order). The load at which silicone rolls over at the foot of an upright edge does not converge, and
    gets no error. Ends under an indenter or with ``self_contact`` are not compared.

    Parameters
    ----------
    path : PadPath
        Path that ends.
    value : (c,) ndarray
        Requested load.
    obstacles : (K, 3, 3) ndarray or None
        Corners in mm of triangles that the pad must not touch.
    end : LoadPathEnds
        End of the path.

    Returns
    -------
    LoadPathEnds
        The same end; the comparison is part of its text.
    """
    if end.value is None or path.load.self_contact or path.load.indenter is not None:
        return end
    here, contact = end.value, end.contact
    at_foot = contact is not None and bool(said_of(contact.what, path.mesh, np.array(contact.place)))

    def on(second: PadPath, _: RoofComparison) -> str:
        where = f" On elements of {second.mesh_size:.3g} mm it"
        try:
            path.on_elements(second.mesh_size, judged=True).state(value, obstacles)
        except LoadPathEnds as other:
            if other.value is None:
                raise
            error = end_error(here, other.value, size_ratio(path.mesh, second.mesh))
            known = error <= LARGEST_ERROR and not at_foot
            stated = f"this end is known to about {max(error, LEAST_ERROR):.0%}" if known else NO_LIMIT
            return f"{where} ends at ({listed(other.value)}) {path.load.unit}: {stated}."
        return f"{where} does not end: {NO_LIMIT}."

    def compared() -> str:
        with path.lock:
            return second_meshes(path).first(on) or ""

    return LoadPathEnds(str(end), end.load, here, contact, compared)


def end_error(value: np.ndarray, other: np.ndarray, ratio: float) -> float:
    """Estimated relative error of the end of a load path.

    Parameters
    ----------
    value : (c,) ndarray
        Load at the end, in N, mm or MPa.
    other : (c,) ndarray
        Load at the end on a second mesh.
    ratio : float
        Element size of the second mesh, relative to the first; not 1.

    Returns
    -------
    float
        Error of the component that differs most, relative to the larger of its two magnitudes.
    """
    change, largest = np.abs(other - value), np.maximum(np.abs(value), np.abs(other))
    relative = np.divide(change, largest, out=np.zeros_like(change), where=largest > 1e-6 * largest.max())
    return float(relative.max()) / abs(ratio**LOCAL_ORDER - 1)
