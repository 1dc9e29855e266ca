"""Parameters of a scene for which derivatives are available."""

from __future__ import annotations

from collections.abc import Iterable

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene import Scene


@in_turn
def without_derivative(scene: Scene, names: Iterable[str]) -> dict[str, str]:
    """Those of ``names`` for which ``scene`` has no derivative, with the reasons in words."""
    from mitsuba_taxel.sensing.scene_rates import rates

    refused = {}
    for name in names:
        try:
            rates(scene, name)
        except InputError as reason:
            refused[name] = str(reason)
    return refused
