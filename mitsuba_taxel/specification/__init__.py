"""Parameters of the plugins: a class per plugin, in a file of its name.

Input: a plugin's parameters, as a scene or Python gives them. Output: an object with checked values, the scene's text
of such an object, and the plugin's reference table.
"""

from __future__ import annotations

from importlib import import_module

from mitsuba_taxel.backend import plugin_files
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.specification.specification import Specification

__all__ = ["Specification", "specification_of", "specifications"]


@kept(None)
def specification_of(plugin: str) -> type[Specification]:
    """The class that specifies the parameters of a plugin of this package.

    Parameters
    ----------
    plugin : str
        Name of the plugin.

    Returns
    -------
    type[Specification]
        The class with the name of the plugin in capitalised words.
    """
    name = "".join(word.capitalize() for word in plugin.split("_"))
    return getattr(import_module(f"{__name__}.{plugin}"), name)


@kept(None)
def specifications() -> dict[str, type[Specification]]:
    """The classes that specify the parameters of all plugins, by the name of the plugin."""
    return {name: specification_of(name) for name in plugin_files()}
