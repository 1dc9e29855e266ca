"""Checks of scenes with a camera instead of phototransistors."""

from __future__ import annotations

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import SceneObjects
from mitsuba_taxel.sensing.scene.description import Scene


def has_camera(objects: SceneObjects) -> bool:
    """Whether a scene has one of Mitsuba's own sensors, such as a camera.

    Parameters
    ----------
    objects : SceneObjects
        Objects of the scene.

    Returns
    -------
    bool
        True for a camera, also beside phototransistors.
    """
    sensors = [sensor for obj in objects.roots for sensor in ([obj] if obj.kind == "sensor" else obj.nested("sensor"))]
    return any(sensor.plugin != "phototransistor" for sensor in sensors)


def check_camera(scene: Scene, objects: SceneObjects) -> list[Finding]:
    """Find properties of a scene that `camera_image` refuses; all objects must be valid, and pads are deformed.

    Parameters
    ----------
    scene : Scene
        The scene.
    objects : SceneObjects
        Objects of the scene.

    Returns
    -------
    list[Finding]
        An error, or nothing.
    """
    from mitsuba_taxel.sensing.camera_view import refuse_unseen, view_of

    try:
        refuse_unseen(scene)
        view_of(scene.load())
    except (InputError, ComputationError) as error:
        return [Finding("error", str(error), objects.file, 0, stopped=isinstance(error, ComputationError))]
    return []
