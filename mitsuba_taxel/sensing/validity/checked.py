"""Checks of a loaded scene before light is traced; they are skipped if the scene has not changed since they last
passed."""

from __future__ import annotations

import mitsuba as mi

from mitsuba_taxel.kernels.protocols import PhototransistorSensor, is_phototransistor
from mitsuba_taxel.kernels.scene_state import KnownScene, SceneState, UnknownState
from mitsuba_taxel.sensing.validity.modelled import refuse_unmodelled
from mitsuba_taxel.sensing.validity.probes import refuse_unreadable


def check_readable(scene: mi.Scene, integrator: mi.Integrator) -> None:
    """Check that the readings of a scene would be right, and that their computation would end; raise an error
    otherwise.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    integrator : mi.Integrator
        The integrator that traces its light.

    Raises
    ------
    InputError
        as :func:`refuse_unmodelled`.
    ComputationError
        as :func:`refuse_unmodelled` and :func:`refuse_unreadable`.
    """
    keeper = _keeper(scene)
    checked = None if keeper is None or keeper.checked is None else keeper.checked.state
    if checked is not None and checked == _state_of(scene, integrator):
        return
    refuse_unmodelled(scene, integrator)
    refuse_unreadable(scene, integrator)
    if keeper is not None:
        keeper.checked = KnownScene(_state_of(scene, integrator))  # checks may move pads


def known_points(scene: mi.Scene) -> dict[float, int]:
    """Cache of the pilot runs of a checked scene: number of points per taxel and replicate, by the relative error of
    the light that they reach.

    Callers add to this dictionary.
    """
    keeper = _keeper(scene)
    return {} if keeper is None or keeper.checked is None else keeper.checked.points


def _keeper(scene: mi.Scene) -> PhototransistorSensor | None:
    """The first phototransistor of a scene: the object on which the result of the check is stored."""
    return next((sensor for sensor in scene.sensors() if is_phototransistor(sensor)), None)


def _state_of(scene: mi.Scene, integrator: mi.Integrator) -> SceneState | None:
    """State of a scene, for comparison; None if the scene contains objects whose state cannot be read."""
    try:
        return SceneState(scene, integrator)
    except UnknownState:
        return None
