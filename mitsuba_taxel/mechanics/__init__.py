"""The deformed pad: nearly incompressible finite elements at finite strain, and load paths.

Input: a pad, a material law, a load and its values. Output: a state of the pad for each value, with displacements,
forces, largest strain, derivatives and the error of each.
"""

import lazy_loader

# Loaded lazily: a scene without a pad imports none of this.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
