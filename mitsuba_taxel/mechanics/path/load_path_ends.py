"""What ends a load path."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.bezier_patches import Place
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.feet import said_of
from mitsuba_taxel.mechanics.contact.self_contact import Contact
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.path.solution import UNSTABLE


class LoadPathEnds(ComputationError):
    """A load path does not lead as far as it was to.

    Attributes
    ----------
    load : Load or None
        Of which `value` is one.
    value : ndarray or None
        (3,) in N or mm, or (1,) in MPa: the last of which there is a state.
    contact : Contact or None
        What the deformed pad touches there; None if it ends for other reasons.
    """

    def __init__(
        self,
        message: object,
        load: Load | None = None,
        value: np.ndarray | None = None,
        contact: Contact | None = None,
    ) -> None:
        super().__init__(message)
        self.load, self.value, self.contact = load, value, contact

    def at(self, load: Load, value: np.ndarray) -> LoadPathEnds:
        """The same end, named by another load and its value there."""
        assert self.load is not None and self.value is not None
        words = str(self).replace(_shown(self.load, self.value), _shown(load, value))
        return LoadPathEnds(words, load, value, self.contact)

    def under(self, load: Load, value: np.ndarray) -> LoadPathEnds:
        """The same end, named by the force on an indenter and by the displacement that it drives."""
        assert self.load is not None and self.value is not None
        driven = _shown(self.load, self.value)
        return LoadPathEnds(str(self).replace(driven, f"{_shown(load, value)}, {driven}"), load, value, self.contact)


def end_of_path(
    mesh: VolumeMesh,
    load: Load,
    value: np.ndarray,
    reason: str,
    place: np.ndarray,
    buckled_at: np.ndarray | None,
    folded_at: Place | None = None,
) -> LoadPathEnds:
    """The end of a path at a ``value``, for a ``reason`` such as "touches the board", at a ``place`` (3,) in mm.

    The place is NaN where there is none; ``buckled_at`` is the load at which the pad buckled before, ``folded_at`` the
    place of a fold beside an inner edge where no state is found.
    """
    where = f" near ({_listed(place)}) mm, which is outside the model" if np.all(np.isfinite(place)) else ""
    touched, what = reason.startswith("touches"), reason.removeprefix("touches ")
    further = ""
    if touched and load.self_contact:
        further = " It may go on with smaller elements."
    elif touched:
        further = " With self_contact = true it goes on."
    elif folded_at:
        near = _listed(np.array(folded_at))
        further = f" It is folded into itself at an inner edge, near ({near}) mm: self_contact = true prevents that."
    elif UNSTABLE in reason and load.moved_indenter is not None and load.has_position:
        further = (
            " At the edge of a contact that may be due to large elements: smaller ones, by mesh_size, may bear it."
        )
    further = said_of(what, mesh, place) + further
    if buckled_at is not None:
        further = f" It buckled at {_shown(load, buckled_at)}, into one of its mirrored shapes.{further}"
    words = f"the pad {reason}{where}: the load path ends at {_shown(load, value)}.{further}"
    return LoadPathEnds(words, load, value, Contact(what, tuple(place.tolist())) if touched else None)


def _shown(load: Load, value: np.ndarray) -> str:
    shown = f"({_listed(value)})" if len(value) == 3 else _listed(value)
    return f"{load.quantity} = {shown} {load.unit}"


def _listed(numbers: np.ndarray) -> str:
    return ", ".join(f"{number:.4g}" for number in numbers)
