"""Kinds of rigid indenters, a file each.

A module here defines one subclass of :class:`~mitsuba_taxel.mechanics.contact.indenter_shape.IndenterShape`; all
modules are imported, so that a new kind needs only a new file.
"""

from mitsuba_taxel.base.kinds import import_all

import_all(__name__, __path__)
