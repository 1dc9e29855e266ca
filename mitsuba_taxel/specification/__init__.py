"""Parameters of each plugin, stated once: a class per plugin, in a file of its name."""

from __future__ import annotations

from importlib import import_module

from mitsuba_taxel.backend import plugin_files
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.specification.specification import Specification

__all__ = ["Specification", "specification_of", "specifications"]


@kept(None)
def specification_of(plugin: str) -> type[Specification]:
    """The specification of a plugin of this package.

    Parameters
    ----------
    plugin : str
        Its name.

    Returns
    -------
    type[Specification]
        The class that is named as the plugin.
    """
    name = "".join(word.capitalize() for word in plugin.split("_"))
    return getattr(import_module(f"{__name__}.{plugin}"), name)


@kept(None)
def specifications() -> dict[str, type[Specification]]:
    """Those of all plugins, by name."""
    return {name: specification_of(name) for name in plugin_files()}
