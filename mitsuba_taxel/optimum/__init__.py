"""Design optimisation within bounds and constraints, with gradients of the whole chain."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
