"""The deformed pad: nearly incompressible finite elements at finite strain, and load paths."""

import lazy_loader

# Loaded lazily: a scene without a pad imports none of this.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
