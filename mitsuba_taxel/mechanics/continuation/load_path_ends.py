"""Ends of load paths, and their messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.bezier_patches import Place
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.continuation.load_segment import Followed, LoadSegment
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.equilibrium.feet import said_of
from mitsuba_taxel.mechanics.equilibrium.solution import UNSTABLE


class LoadPathEnds(ComputationError):
    """The load path ends before the requested load.

    Attributes
    ----------
    load : Load or None
        Load whose value is `value`.
    value : ndarray or None
        Last value with a state: (3,) in N or mm, or (1,) in MPa.
    contact : Contact or None
        Object that the deformed pad touches there; None if the path ends for another reason.
    compared : Callable[[], str] or None
        Returns a sentence about the end on other elements, which follows the message. It is called when the message is
        first read, because that path may have to be solved.
    """

    def __init__(
        self,
        message: object,
        load: Load | None = None,
        value: np.ndarray | None = None,
        contact: Contact | None = None,
        compared: Callable[[], str] | None = None,
    ) -> None:
        super().__init__(message)
        self.load, self.value, self.contact, self.compared = load, value, contact, compared

    def __str__(self) -> str:
        message, compared = self.args[0], self.compared
        if compared is not None:
            try:
                sentence = compared()
            except (ComputationError, InputError):  # the end itself is known
                sentence = ""
            self.args, self.compared = (f"{message}{sentence}",), None
        return super().__str__()

    def __reduce__(self) -> tuple[type[LoadPathEnds], tuple[object, ...]]:
        return type(self), (str(self), self.load, self.value, self.contact)

    def at(self, load: Load, value: np.ndarray) -> LoadPathEnds:
        """Copy of this error for another kind of load: ``value`` is the value of that load at the end of the path."""
        assert self.load is not None and self.value is not None
        words = str(self).replace(_shown(self.load, self.value), _shown(load, value))
        return LoadPathEnds(words, load, value, self.contact)

    def under(self, load: Load, value: np.ndarray) -> LoadPathEnds:
        """Copy of this error for an indenter that is pressed by a force. Its message states the largest force first,
        then the displacement of the indenter.
        """
        assert self.load is not None and self.value is not None
        driven = _shown(self.load, self.value)
        return LoadPathEnds(str(self).replace(driven, f"{_shown(load, value)}, {driven}"), load, value, self.contact)

    def mirrored(self, load: Load, mirrors: Sequence[Mirror]) -> LoadPathEnds | None:
        """The same error at a place that symmetries of the pad map to the place of this error.

        Parameters
        ----------
        load : Load
            The same kind of load, at the other place.
        mirrors : Sequence[Mirror]
            Mirrors that map the place of this error to the other place, in this order.

        Returns
        -------
        LoadPathEnds or None
            None if the message states sideways values, or points other than that of a contact, which cannot be
            mirrored.
        """
        if self.value is None or self.value[:2].any() or type(self.load) is not type(load):
            return None
        words, contact = str(self), self.contact
        if contact is not None:
            place = np.array(contact.place)
            stated = f"near ({listed(place)}) mm"
            for mirror in mirrors:
                place = mirror.image(place)
            contact = replace(contact, place=tuple(place.tolist()))
            words = words.replace(stated, f"near ({listed(place)}) mm", 1)
            if words.count("near (") > 1:
                return None
        elif "near (" in words:
            return None
        return LoadPathEnds(words, load, self.value, contact)


def end_of_path(
    mesh: VolumeMesh,
    load: Load,
    value: np.ndarray,
    reason: str,
    place: np.ndarray,
    buckled_at: np.ndarray | None,
    folded_at: Place | None = None,
) -> LoadPathEnds:
    """Create the error that states where and why a load path ends.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    load : Load
        Kind of load.
    value : (c,) ndarray
        Last value with a state.
    reason : str
        Reason for the end, such as "touches the board".
    place : (3,) ndarray
        Point of contact, mm; NaN without.
    buckled_at : (c,) ndarray or None
        Load at which the pad buckled before.
    folded_at : Place or None
        Point of a fold at an inner edge, mm.

    Returns
    -------
    LoadPathEnds
        Error with the message.
    """
    where = f" near ({listed(place)}) mm, which is outside the model" if np.all(np.isfinite(place)) else ""
    touched, what = reason.startswith("touches"), reason.removeprefix("touches ")
    hint = ""
    if touched and load.self_contact:
        hint = " The path may continue on smaller elements: try a smaller mesh_size."
    elif load.tilts and (touched or folded_at):
        hint = " Contact under a tilting plate is not modelled: a smaller load is needed."
    elif touched:
        hint = " With self_contact = true the path continues."
    elif folded_at:
        location = listed(np.array(folded_at))
        hint = f" It is folded into itself at an inner edge, near ({location}) mm: self_contact = true prevents that."
    elif UNSTABLE in reason and load.moved_indenter is not None and load.has_position:
        hint = " The elements may be too large at the edge of the contact: try a smaller mesh_size."
    hint = said_of(what, mesh, place) + hint
    if buckled_at is not None:
        hint = f" It buckled at {_shown(load, buckled_at)}, into one of its mirrored shapes.{hint}"
    words = f"the pad {reason}{where}: the load path ends at {_shown(load, value)}.{hint}"
    return LoadPathEnds(words, load, value, Contact(what, tuple(place.tolist())) if touched else None)


def _shown(load: Load, value: np.ndarray) -> str:
    return f"{load.quantity} = {amount(load, value)}"


def amount(load: Load, value: np.ndarray) -> str:
    """Value of a load as text with units, such as "(0, 0, -1) N"; the moment of a plate follows its force."""
    shown = f"({listed(value[:3])})" if len(value) > 1 else listed(value)
    moment = f" and moment = ({listed(value[3:])}) N mm" if load.tilts else ""
    return f"{shown} {load.unit}{moment}"


def listed(numbers: np.ndarray) -> str:
    """Numbers as text with four digits, separated by commas."""
    return ", ".join(f"{number:.4g}" for number in numbers)


def refuse_at_rest(contact: Contact | None, mirrors: Sequence[Mirror] = ()) -> None:
    """Refuse an undeformed pad that touches something.

    Parameters
    ----------
    contact : Contact or None
        A contact of the undeformed pad.
    mirrors : Sequence[Mirror]
        Mirrors that were applied to the pad.

    Raises
    ------
    InputError
        if there is a contact.
    """
    if contact:
        point = np.array(contact.place)
        for mirror in reversed(mirrors):
            point = mirror.image(point)
        shown = ", ".join(f"{coordinate:.3g}" for coordinate in point)
        raise InputError(f"the undeformed pad touches {contact.what} near ({shown}) mm of the pad: move one of them.")


class Obstacles:
    """Rigid obstacles of a pad, with the loads at which the pad is known to touch them first.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    triangles : (K, 3, 3) ndarray
        Corners of the triangles of their closed surfaces, in mm in the frame of the pad.
    mirrors : sequence of Mirror
        Mirrors by which the obstacles are reflected, one after the other: the same reflections as those of the load.

    Raises
    ------
    InputError
        if they are not triangles, or the undeformed pad touches them.
    """

    def __init__(self, mesh: VolumeMesh, triangles: np.ndarray, mirrors: Sequence[Mirror]) -> None:
        for mirror in mirrors:
            triangles = mirror.image(triangles)
        self._test = ContactTest(mesh, triangles)
        self._clear: dict[LoadSegment, int] = {}
        self._first: dict[LoadSegment, tuple[float, Contact]] = {}
        refuse_at_rest(self._test.find_package(np.zeros_like(mesh.points)), mirrors)

    def first(self, segment: LoadSegment, pad: Followed) -> tuple[float, Contact] | None:
        """The first contact of the pad with an obstacle along the solved part of a straight segment of its load path.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        pad : Followed
            The pad of the segment.

        Returns
        -------
        tuple[float, Contact] or None
            Distance in N, mm or MPa, and the contact; None without.
        """
        for index in range(self._clear.get(segment, 1), len(segment.nodes)):
            if segment not in self._first:
                first_contact = segment.first_contact(pad, index, self._test.find_package)
                if first_contact:
                    self._first[segment] = first_contact
            self._clear[segment] = index + 1
        return self._first.get(segment)

    def touch(self, displacement: np.ndarray) -> bool:
        """Whether the pad touches an obstacle when its N nodes have a displacement (N, 3)."""
        return self._test.find_package(displacement) is not None
