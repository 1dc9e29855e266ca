"""Refusal of Mitsuba's own BSDFs for which readings would be wrong, or would fail without a helpful message."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_wall
from mitsuba_taxel.kernels.walls import walls_of

_SHARES = ("reflectance", "transmittance", "base_color")
"""Ends of the names of parameters that are fractions of the light."""


def refuse_foreign_walls(scene: mi.Scene, plugin: str) -> None:
    """Raise `InputError` for Mitsuba's own BSDFs that reflect more light than they receive, that cannot be evaluated,
    or that the integrator does not support.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    plugin : str
        Name of Mitsuba's integrator for the scene; empty for an integrator of this package.

    Raises
    ------
    InputError
        if there is such a BSDF; the message names it.
    """
    for wall in walls_of(scene):
        if wall is None or is_wall(wall):
            continue
        _refuse_more_than_all(wall)
        _refuse_unevaluated(wall)
        flags = wall.flags()
        if plugin == "path" and flags & mi.BSDFFlags.Null and flags & mi.BSDFFlags.Smooth:
            raise InputError(
                f"integrator path loses light that passes through a partly transparent {kind_of(wall)}: use "
                "taxel_tracer or volpath.",
                wall,
            )


def _refuse_more_than_all(wall: mi.BSDF) -> None:
    """Raise `InputError` for a reflectance or other fraction of the light outside 0 to 1."""
    for name, value in mi.traverse(wall).items():
        *path, last = name.split(".")
        if last not in ("value", "data") or not any(word.endswith(_SHARES) for word in path):
            continue
        values = np.array(value, dtype=float)
        outside = values[(values < 0) | (values > 1)]
        if outside.size:
            parameter = name.removesuffix(f".{last}")
            raise InputError(
                f"{kind_of(wall)}: {parameter} = {outside.flat[0]:g} is not allowed: a fraction of the light from 0 to "
                "1 is needed.",
                wall,
            )


def _refuse_unevaluated(wall: mi.BSDF) -> None:
    """Raise `InputError` for a BSDF that Mitsuba cannot evaluate in this variant, such as a bump map with a
    checkerboard."""
    try:
        wall.eval(mi.BSDFContext(), dr.zeros(mi.SurfaceInteraction3f, 1), mi.Vector3f(0, 0, 1))
    except RuntimeError as error:
        raise InputError(f"{kind_of(wall)}: {error}", wall) from None
