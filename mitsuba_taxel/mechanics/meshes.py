"""Cached meshes of pads."""

from __future__ import annotations

from weakref import WeakValueDictionary

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.parametric.pad import Pad

_IN_USE: WeakValueDictionary[str, VolumeMesh] = WeakValueDictionary()


def pad_mesh(pad: AnyPad, mesh_size: float) -> VolumeMesh:
    """The undeformed mesh of a pad, with elements of a size in mm, from disk or from the mesher.

    While it is in use, all callers get the same object, so that results that depend on the mesh alone are computed
    once.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    mesh_size : float
        Length of the edges of elements, mm.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.
    """
    name = _name(pad, mesh_size)
    with cache.alone(name):
        arrays = cache.load(name)
        if arrays is None:
            mesh = pad.mesh(mesh_size, pad_mesh) if isinstance(pad, Pad) else pad.mesh(mesh_size)
            cache.store(name, vars(mesh))
            return _IN_USE.setdefault(name, mesh)
    return _IN_USE.get(name) or _IN_USE.setdefault(name, VolumeMesh(**arrays))


def is_meshed(pad: AnyPad, mesh_size: float) -> bool:
    """Whether the mesh of a pad with elements of a size in mm is on disk."""
    return cache.holds(_name(pad, mesh_size))


def _name(pad: AnyPad, mesh_size: float) -> str:
    return cache.key("mesh", [pad.identity, mesh_size])
