"""Checks of a loaded scene before it is read, left out while it is as it was when last checked."""

from __future__ import annotations

import mitsuba as mi

from mitsuba_taxel.kernels.protocols import is_phototransistor
from mitsuba_taxel.kernels.scene_state import SceneState, UnknownState
from mitsuba_taxel.sensing.modelled import refuse_unmodelled
from mitsuba_taxel.sensing.probes import refuse_unreadable


def check_readable(scene: mi.Scene, integrator: mi.Integrator) -> None:
    """Raise as :func:`refuse_unmodelled` and :func:`refuse_unreadable` do."""
    keepers = [sensor for sensor in scene.sensors() if is_phototransistor(sensor)]
    state = _state_of(scene, integrator)
    if keepers and state is not None and keepers[0].checked == state:
        return
    refuse_unmodelled(scene, integrator)
    refuse_unreadable(scene, integrator)
    if keepers:
        keepers[0].checked = _state_of(scene, integrator)  # checks may move pads


def _state_of(scene: mi.Scene, integrator: mi.Integrator) -> SceneState | None:
    try:
        return SceneState(scene, integrator)
    except UnknownState:
        return None
