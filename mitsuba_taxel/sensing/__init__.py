"""Scenes, their parts as Python objects, and readings with their error."""

import lazy_loader

# Plugins import modules of this package individually, before any variant is set.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
