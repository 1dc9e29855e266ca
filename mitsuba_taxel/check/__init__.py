"""Scenes looked over before they are rendered: names, units, places and light."""

import lazy_loader

# The schema asks for the plugins' tables alone, which needs no variant.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
