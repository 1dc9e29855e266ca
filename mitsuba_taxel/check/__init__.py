"""Checks of scenes before rendering: names, units, positions and light."""

import lazy_loader

# The schema needs only the plugins' tables, and no variant.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
