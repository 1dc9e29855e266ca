"""Checks of a loaded scene before it is read, left out while it is as it was when last checked."""

from __future__ import annotations

import mitsuba as mi

from mitsuba_taxel.kernels.protocols import PhototransistorSensor, is_phototransistor
from mitsuba_taxel.kernels.scene_state import KnownScene, SceneState, UnknownState
from mitsuba_taxel.sensing.validity.modelled import refuse_unmodelled
from mitsuba_taxel.sensing.validity.probes import refuse_unreadable


def check_readable(scene: mi.Scene, integrator: mi.Integrator) -> None:
    """Raise as :func:`refuse_unmodelled` and :func:`refuse_unreadable` do."""
    keeper = _keeper(scene)
    known = None if keeper is None or keeper.checked is None else keeper.checked.state
    if known is not None and known == _state_of(scene, integrator):
        return
    refuse_unmodelled(scene, integrator)
    refuse_unreadable(scene, integrator)
    if keeper is not None:
        keeper.checked = KnownScene(_state_of(scene, integrator))  # checks may move pads


def found_points(scene: mi.Scene) -> dict[float, int]:
    """Points per taxel and replicate for relative errors of the light, as found since the scene was checked, to be
    added to."""
    keeper = _keeper(scene)
    return {} if keeper is None or keeper.checked is None else keeper.checked.points


def _keeper(scene: mi.Scene) -> PhototransistorSensor | None:
    """The first phototransistor, with which is kept what is known."""
    return next((sensor for sensor in scene.sensors() if is_phototransistor(sensor)), None)


def _state_of(scene: mi.Scene, integrator: mi.Integrator) -> SceneState | None:
    try:
        return SceneState(scene, integrator)
    except UnknownState:
        return None
