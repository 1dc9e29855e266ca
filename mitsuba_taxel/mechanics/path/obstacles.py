"""First contact of a pad with rigid obstacles on a load path.

Obstacles do not change the states of a path, which are therefore cached for all obstacles. Those that hold the pad,
where a load goes on, are the bodies of a path of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.path.load_segment import Followed, LoadSegment


def refuse_at_rest(contact: Contact | None, mirrors: Sequence[Mirror] = ()) -> None:
    """Raise `InputError` if there is a contact of the undeformed pad, where ``mirrors`` took it."""
    if contact:
        place = np.array(contact.place)
        for mirror in reversed(mirrors):
            place = mirror.image(place)
        shown = ", ".join(f"{coordinate:.3g}" for coordinate in place)
        raise InputError(f"the undeformed pad touches {contact.what} near ({shown}) mm of the pad: move one of them.")


class Obstacles:
    """Rigid obstacles of a pad, with the known first contacts on the segments of its paths.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the undeformed pad.
    triangles : (K, 3, 3) ndarray
        In mm, corners of the triangles of their closed surfaces, in the frame of the pad.
    mirrors : sequence of Mirror
        Applied to them in sequence, as to the load of the segments.

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
        """Distance along a segment, as far as it is solved, to the first contact, and that contact; else None."""
        for index in range(self._clear.get(segment, 1), len(segment.nodes)):
            if segment not in self._first:
                found = segment.first_contact(pad, index, self._test.find_package)
                if found:
                    self._first[segment] = found
            self._clear[segment] = index + 1
        return self._first.get(segment)

    def touch(self, displacement: np.ndarray) -> bool:
        """Whether a pad of a displacement (N, 3) touches them."""
        return self._test.find_package(displacement) is not None
