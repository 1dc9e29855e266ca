"""Parameters of a scene for which derivatives are available."""

from __future__ import annotations

from collections.abc import Iterable

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.description import Scene

WITHOUT_PAD = "the scene holds no pad: its derivatives are differences of random paths, whose noise studies do not take"


@in_turn
def without_derivative(scene: Scene, names: Iterable[str]) -> dict[str, str]:
    """Parameters by which a study has no derivatives of a scene.

    Parameters
    ----------
    scene : Scene
        Of the study.
    names : Iterable[str]
        Parameters by which derivatives are wanted.

    Returns
    -------
    dict[str, str]
        The reason for each name that has none; empty if all have.
    """
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates

    refused = {}
    for name in names:
        try:
            if not rates(scene, name).load.size:
                refused[name] = WITHOUT_PAD
        except InputError as reason:
            refused[name] = str(reason)
    return refused
