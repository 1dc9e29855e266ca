"""Kinds of rigid indenters, a file each.

A module here defines one subclass of :class:`~mitsuba_taxel.mechanics.contact.indenter_shape.IndenterShape`; all are
imported, so that a new file is all that a new kind takes.
"""

from mitsuba_taxel.base.kinds import import_all

import_all(__name__, __path__)
