"""The deformed pad: finite strain, nearly incompressible finite elements, and the path to a load."""

import lazy_loader

# A scene without a pad imports none of this.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
