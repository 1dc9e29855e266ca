"""Parameters of a scene with respect to which readings have no derivative."""

from __future__ import annotations

from collections.abc import Iterable

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.description import Scene

WITHOUT_PAD = "the scene has no pad, and a study stores derivatives of pads alone"


@in_turn
def without_derivative(scene: Scene, names: Iterable[str]) -> dict[str, str]:
    """Find the parameters with respect to which a study of a scene cannot store derivatives, with the reasons.

    Parameters
    ----------
    scene : Scene
        Description of the scene; it need not be loaded.
    names : iterable of str
        Names of parameters of the scene, or of components of its load.

    Returns
    -------
    dict[str, str]
        Reason for each parameter without a derivative, by name; empty if all have one.
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
