"""Parameters of a scene for which derivatives are available."""

from __future__ import annotations

from collections.abc import Iterable

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.description import Scene

WITHOUT_PAD = "the scene has no pad, and a study stores derivatives of pads alone"


@in_turn
def without_derivative(scene: Scene, names: Iterable[str]) -> dict[str, str]:
    """Parameters without derivatives in a study of a scene, with the reasons.

    Parameters
    ----------
    scene : Scene
        Scene described, not loaded.
    names : iterable of str
        Parameters of the scene, or components of its load.

    Returns
    -------
    dict[str, str]
        Reasons by name.
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
