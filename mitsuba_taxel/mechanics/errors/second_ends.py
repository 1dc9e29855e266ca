"""Ends of load paths compared with those on a second mesh: an end that depends on the elements is no limit of the
sensor."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.convergence import LOCAL_ORDER
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, amount
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.elements.loads import normal_part
from mitsuba_taxel.mechanics.equilibrium.feet import said_of
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison, size_ratio
from mitsuba_taxel.mechanics.errors.second_meshes import second_meshes

LARGEST_ERROR = 0.1
"""Largest relative error of an end that is stated. With a larger error the end is said to depend on the elements."""
LEAST_ERROR = 0.01
"""Least relative error of an end that is stated."""
FURTHER = 1.05
"""Load up to which the second path is solved, at least, relative to the load at which the error would be
:data:`LARGEST_ERROR`."""
NO_LIMIT = "this end depends on the elements, and is no limit of the sensor"


def end_on_second_mesh(
    path: PadPath, value: np.ndarray, obstacles: np.ndarray | None, end: LoadPathEnds
) -> LoadPathEnds:
    """Add a comparison to the message of an end: the end of the same path on a second mesh, and either an error or the
    statement that the end depends on the elements.

    The second mesh is that from which the errors of states are estimated, mostly with elements of twice the size. Its
    path is solved when the message is first read, beyond the requested load if this load is little larger than the end.
    The error is assumed to fall with the element size (L. F. Richardson, 1911, of first order). The load at which
    silicone rolls over at the foot of an upright edge does not converge, and gets no error. Ends under an indenter or
    with ``self_contact`` are not compared.

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
        where, ratio = f" On elements of {second.mesh_size:.3g} mm it", size_ratio(path.mesh, second.mesh)
        furthest = furthest_value(value, here, ratio)
        try:
            path.on_elements(second.mesh_size, judged=True).state(furthest, obstacles)
        except LoadPathEnds as other:
            if other.value is None:
                raise
            error = end_error(here, other.value, ratio)
            known = error <= LARGEST_ERROR and not at_foot
            stated = f"this end is known to about {max(error, LEAST_ERROR):.0%}" if known else NO_LIMIT
            return f"{where} ends at {amount(path.load, other.value)}: {stated}."
        return f"{where} reaches {amount(path.load, furthest)}: {NO_LIMIT}."

    def compared() -> str:
        with path.lock:
            return second_meshes(path).first(on) or ""

    return LoadPathEnds(str(end), end.load, here, contact, compared)


def furthest_value(value: np.ndarray, end: np.ndarray, ratio: float) -> np.ndarray:
    """Load up to which a path is solved on a second mesh, so that its end there does not depend on the requested load.

    Parameters
    ----------
    value : (c,) ndarray
        Requested load, in N, N mm, mm or MPa.
    end : (c,) ndarray
        Load at the end.
    ratio : float
        Element size of the second mesh, relative to the first; not 1.

    Returns
    -------
    (c,) ndarray
        Load on the straight part of the path that contains the end: along z first, then in all other components. It is
        the requested load there, or a larger one at which the relative error of the end would exceed
        :data:`LARGEST_ERROR`.
    """
    factor = FURTHER / (1 - min(LARGEST_ERROR * abs(ratio**LOCAL_ORDER - 1), 0.5))
    requested, normal = normal_part(value), normal_part(end)
    if np.abs(requested).max() > np.abs(normal).max():
        return max(requested, factor * normal, key=lambda load: float(np.abs(load).max()))
    others = max(value - requested, factor * (end - normal), key=lambda load: float(np.linalg.norm(load)))
    return np.asarray(normal + others)


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
