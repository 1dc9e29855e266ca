"""Simulation of optoelectronic tactile sensors: force, deformed pad, light, reading.

Importing this package chooses an LLVM that works, imports mitsuba and makes its plugins known to
``mi.load_file``, ``mi.load_string`` and ``mi.load_dict`` in every variant. Nothing else heavy is imported.

Units everywhere: mm, N, MPa, W, s; angles in degrees.
"""

from __future__ import annotations

import lazy_loader

from mitsuba_taxel.backend import check_llvm, choose_llvm, register_for_every_variant, wanted_variant
from mitsuba_taxel.backend.turns import uninterrupted
from mitsuba_taxel.base.display import Displayed

with uninterrupted():
    choose_llvm()
    check_llvm(wanted_variant())
    register_for_every_variant()


def _html_of(shown: Displayed) -> str:
    from mitsuba_taxel.report.notebook.views import html_of

    return html_of(shown)


Displayed.html_of = _html_of
_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("mitsuba_taxel")
    return _public(name)
