"""Simulation of optoelectronic tactile sensors: force, deformed pad, light, reading.

Importing this package selects a suitable LLVM, imports mitsuba, and registers the plugins for ``mi.load_file``,
``mi.load_string`` and ``mi.load_dict`` in every variant. Other large packages are imported when they are used.

All units are mm, N, MPa, W and s; angles are in degrees.
"""

from __future__ import annotations

import lazy_loader

from mitsuba_taxel.backend import check_llvm, choose_llvm, load_drjit, register_for_every_variant, wanted_variant
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.fitted import Fitted
from mitsuba_taxel.base.processes.system import deferred_signals

with deferred_signals():
    choose_llvm()
    load_drjit()
    check_llvm(wanted_variant())
    register_for_every_variant()


def _html_of(displayed: Displayed) -> str:
    """HTML view of an object for notebooks; the package `report` is imported at the first call."""
    from mitsuba_taxel.report.notebook.views import html_of

    return html_of(displayed)


def _fit_of(law: type[Fitted], *tests: object, **settings: object) -> object:
    """Fit of a law to tests of a silicone; the package `fitting` is imported at the first call."""
    from mitsuba_taxel.fitting.material.material_fit import fit_class

    return fit_class(law, *tests, **settings)


Displayed.html_of, Fitted.fit_of = _html_of, _fit_of
_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("mitsuba_taxel")
    return _public(name)
