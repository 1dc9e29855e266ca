"""Velocities of a pad's nodes under changes of its dimensions, at fixed connectivity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.base.arguments import refusal, require
from mitsuba_taxel.base.differences import STENCILS
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.cells import CellShape
from mitsuba_taxel.pads.parametric.edge_zones import carried
from mitsuba_taxel.pads.parametric.lean import AXES, lean, lean_rate, leans, on_round_walls, upright_nodes
from mitsuba_taxel.pads.parametric.pad import FILLETS, Pad
from mitsuba_taxel.pads.parametric.rounding import rounding, sharp_nodes
from mitsuba_taxel.parameters import parameters_of

STEP = 1e-3
"""Relative change of the difference quotient for positions, which are linear in each length."""
LEAN_STEP = 1e-4
"""Change in mm of the difference quotient for the shift of leaning cells."""
FILLET_STEP = 1e-6
"""Change in mm of the difference quotient for nodes on fillets, at whose borders the curvature jumps."""
SHAPE_STEP = 1e-5
"""Change of the difference quotient for quantities that are not linear in dimensions, such as the meridian of a
profile."""


def mesh_velocity(pad: Pad, mesh: VolumeMesh, parameter: str) -> np.ndarray:
    """Velocities (N, 3) of the nodes of an undeformed mesh while a dimension of the pad changes, in mm per mm of that
    dimension.

    The other dimensions are fixed; a height of cells that is not set keeps its default at any size. A node on a wall
    stays on it at the same relative position. Inside, velocities are interpolated: linearly between the walls of cuboid
    cells, and for round cells along rays to the border of the cell's region, from the axis or the centre of the circle
    at the base of the dome. Midpoints of straight edges remain midpoints. Nodes of leaning cells have the velocity in
    the upright cell plus the rate of their shift.

    Parameters
    ----------
    pad : Pad
        Pad before the change.
    mesh : VolumeMesh
        Mesh of the pad, undeformed: ``state.mesh`` of its states.
    parameter : str
        Name of the dimension: pitch, wall, height, cell_size, cell_height, top_x, top_y, a fillet, such as
        mouth_fillet, if it is above 0, or a coordinate of a point of a profile, such as ``profile_r1``.

    Returns
    -------
    (N, 3) ndarray
        Velocities of the nodes, in mm per mm.

    Raises
    ------
    InputError
        if the pad has no derivative with respect to the parameter, or its dimension cannot be changed at all.
    """
    require("pad", pad, Pad, "a Pad")
    require("mesh", mesh, VolumeMesh, "a VolumeMesh")
    if isinstance(parameter, str) and parameter in FILLETS and not getattr(pad, parameter):
        raise refusal("parameter", parameter, f"a pad with a {parameter} above 0 is needed")
    if not (isinstance(parameter, str) and parameter in pad.dimensions):
        is_parameter = isinstance(parameter, str) and parameter in parameters_of(Pad)
        reason = "it does not change continuously" if is_parameter else f"one of {', '.join(pad.dimensions)} is needed"
        raise refusal("parameter", parameter, reason)
    upright = upright_nodes(pad, mesh)
    if parameter in AXES:
        return lean_rate(pad, mesh, upright, parameter)
    sharp = sharp_nodes(pad, mesh, upright)
    target, step = _perturbed(pad, parameter)

    def difference(function: Callable[[CellShape], np.ndarray]) -> np.ndarray:
        return step * rate_by(pad, parameter, SHAPE_STEP, lambda changed, _: function(changed.shape))

    velocity = pad.shape.shifts(target.shape, sharp, difference) / step
    if pad.mouth is not None or pad.outside is not None:
        velocity = rate_by(
            pad, parameter, FILLET_STEP, lambda changed, step: carried(pad, changed, sharp, sharp + step * velocity)
        )
    middles = velocity[mesh.corner_count :]
    straight = ~on_round_walls(pad, mesh)[mesh.corner_count :]
    middles[straight] = velocity[edge_ends(mesh.tets)[straight]].mean(axis=1)
    if pad.fillet or pad.mouth is not None or pad.outside is not None:
        velocity = velocity + rate_by(
            pad, parameter, FILLET_STEP, lambda changed, step: rounding(changed, mesh, sharp + step * velocity, pad)
        )
    if not leans(pad):
        return velocity
    return velocity + rate_by(
        pad, parameter, LEAN_STEP, lambda changed, step: lean(changed, mesh, upright + step * velocity)
    )


def _perturbed(pad: Pad, parameter: str) -> tuple[Pad, float]:
    """The pad with a slightly larger dimension, or a slightly smaller one if the larger is not allowed, and the change
    in mm."""
    value = pad.dimensions[parameter]
    step = STEP * value
    try:
        return pad.changed(**{parameter: value + step}), step
    except InputError:
        return pad.changed(**{parameter: value - step}), -step


def rate_by(pad: Pad, parameter: str, step: float, at: Callable[[Pad, float], np.ndarray]) -> np.ndarray:
    """Derivative of a function of the pad with respect to one of its dimensions, by finite differences.

    Parameters
    ----------
    pad : Pad
        The pad, with lengths in mm.
    parameter : str
        Name of the dimension.
    step : float
        Step of the differences, mm.
    at : Callable[[Pad, float], ndarray]
        Function of the changed pad and of the change in mm.

    Returns
    -------
    ndarray
        Derivative per mm, in the shape of the function's values.

    Raises
    ------
    InputError
        if the dimension cannot be changed.
    """
    value = pad.dimensions[parameter]
    for stencil in STENCILS:
        try:
            pads = [pad.changed(**{parameter: value + offset * step}) for _, offset in stencil]
        except InputError as error:
            refused = error
        else:
            values = (w * at(changed, offset * step) for (w, offset), changed in zip(stencil, pads, strict=True))
            return sum(values, start=np.zeros(1)) / step
    raise refused
