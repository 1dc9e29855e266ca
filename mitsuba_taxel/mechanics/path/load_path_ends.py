"""What ends a load path."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics.contact.self_contact import Contact
from mitsuba_taxel.mechanics.elements.loads import Load


class LoadPathEnds(ComputationError):
    """A load path does not lead as far as it was to.

    Attributes
    ----------
    load : Load or None
        Of which `value` is one: under a force on an indenter, the displacement of that.
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
