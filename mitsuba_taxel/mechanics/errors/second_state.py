"""The same load solved on elements of another size: a comparison gives the error of a state's derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import SLOPE_ORDER, TYPICAL_SLOPE_ERROR
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.continuation.mirrored_places import canonical_place, mirrored_state
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.continuation.path_problem import lock_of
from mitsuba_taxel.mechanics.continuation.placed_paths import placed_path, solved_on
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, Load
from mitsuba_taxel.mechanics.errors.mesh_sizes import chosen_size
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison, size_ratio
from mitsuba_taxel.mechanics.errors.second_meshes import compared, second_meshes
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.any_pad import AnyPad


class SecondState(NamedTuple):
    """The state under the same load on a second mesh, with factors by which errors follow from the differences between
    both states.

    Attributes
    ----------
    state : State
        The state.
    share : float
        Error of a derivative on the elements of the first state, relative to the difference of the derivatives on both
        meshes.
    share_of_sum : float
        The same error, relative to the sum of the errors on both meshes.
    least : float
        Least relative error of a rate of the displacement on the elements of the first state.
    """

    state: State
    share: float
    share_of_sum: float
    least: float


def second_state(
    pad: AnyPad,
    material: Material,
    value: Sequence[float],
    *,
    load: Load = SPREAD_FORCE,
    mesh_size: float | None = None,
    mesh_tolerance: float | None = None,
    judged_on: float | None = None,
    bodies: RigidBodies | None = None,
) -> SecondState | None:
    """The state of :func:`load_path` on the second mesh, from which its error is estimated.

    Parameters
    ----------
    pad : AnyPad
        The pad, parametric or from a file. See :func:`load_path`.
    material : Material
        Silicone of the pad. See :func:`load_path`.
    value : sequence of float
        Value of the load, in N, mm or MPa.
    load : Load
        Kind of load, by default a force spread over the top. See :func:`load_path`.
    mesh_size : float, optional
        Size of the finite elements in mm. See :func:`load_path`.
    mesh_tolerance : float, optional
        Instead of a size, the target for the relative error of the roofs' displacement under a small load. See
        :func:`load_path`.
    judged_on : float, optional
        Element size, in mm, of the mesh on which the stability of an elastic pad is tested. See :func:`load_path`.
    bodies : RigidBodies, optional
        Rigid bodies that the pad must not penetrate.

    Returns
    -------
    SecondState or None
        The state; None if there is no second mesh.
    """
    with lock_of(pad):
        size = chosen_size(pad, material, load, mesh_size, mesh_tolerance)
        path = pad_path(pad, material, load, size, judged_on=judged_on, bodies=bodies)
        placed, there = placed_path(path, np.array(value, dtype=float))
        canonical, there, mirrors = canonical_place(placed, there)
        path, there, _ = solved_on(canonical, there)

        def compare(second: PadPath, comparison: RoofComparison) -> SecondState:
            state = compared(second, second.state(there))
            second.refuse_unresolved(there, state.displacement)
            growth = size_ratio(path.mesh, second.mesh) ** SLOPE_ORDER
            least = second_meshes(path).typical(TYPICAL_SLOPE_ERROR)
            return SecondState(mirrored_state(placed, state, mirrors), 1 / abs(growth - 1), 1 / (growth + 1), least)

        return second_meshes(path).first(compare)
