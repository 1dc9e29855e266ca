"""Newton iterations that bring a state of a pad to equilibrium, and its factored tangent matrix, for derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.derivatives.linearised_state import LinearisedState, PressedState, rejections_named
from mitsuba_taxel.mechanics.elements.loads import mirrored_value
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad, mirror_images
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import TangentBlock, tangent_blocks
from mitsuba_taxel.mechanics.history.timed_rows import rubs

SYMMETRIC = 1e-6
"""Largest difference of a symmetric state from its mirror image, relative to the largest displacement."""


def linearise(state: State) -> LinearisedState:
    """Bring a state to equilibrium and factor its tangent, on the part between the planes of symmetry of the state.

    Changes that do not have the symmetry of the state need further factors, which are computed when first needed. A
    state between two nodes of its path is interpolated; one or two iterations of Newton's method bring it to
    equilibrium. Its derivatives are those of the equilibrium, not of the interpolation.

    Parameters
    ----------
    state : State
        State of an elastic pad without friction.

    Returns
    -------
    LinearisedState
        The pad in equilibrium, with its factored tangent.

    Raises
    ------
    InputError
        if it is not a `State`.
    ComputationError
        if there is no stable equilibrium nearby, as at the end of some paths; or if memory does not suffice.
    """
    require("state", state, State, "a State, as load_path returns it,")
    if state.memory is not None and state.memory.time is None:
        raise InputError(
            "derivatives with Mullins' effect are not available: remove mullins, or vary the parameter in a sweep."
        )
    if state.memory is not None:
        raise InputError(
            "derivatives of a viscoelastic silicone are not available: remove prony, or vary the parameter in a sweep."
        )
    if rubs(state.load):
        raise InputError(
            "derivatives with friction are not available: remove friction, or vary the parameter in a sweep."
        )
    load, value, kind = state.load, state.value, LinearisedState
    if load.driven is not None:
        assert state.indenter_moved is not None
        load, value, kind = load.driven, state.indenter_moved, PressedState
    with rejections_named(state.load, state.value):
        pad = loaded_pad(state.mesh, state.material, load, mirrors_of_state(state), state.bodies)
        blocks = _blocks(pad)
        unknowns = pad.gather(state.displacement, state.pressure)
        solution, linearised = pad.solve_with_tangent(unknowns, value)
    return kind(pad, blocks, solution.unknowns, value, linearised)


def mirrors_of_state(state: State) -> tuple[Mirror, ...]:
    """The planes of symmetry (mirrors) of both the pad and its deformed state."""
    images = mirror_images(state.mesh, state.load)
    largest = np.abs(state.displacement).max()

    def keeps_state(mirror: Mirror) -> bool:
        value, u = state.value, state.displacement
        same = np.array_equal(mirrored_value(mirror, value), value)
        return same and float(np.abs(mirror.image(u[images[mirror]]) - u).max()) <= SYMMETRIC * largest

    return tuple(mirror for mirror in images if keeps_state(mirror))


@kept(4)  # consecutive states of a path share their blocks
def _blocks(pad: LoadedPad) -> Sequence[TangentBlock]:
    return tangent_blocks(pad)
