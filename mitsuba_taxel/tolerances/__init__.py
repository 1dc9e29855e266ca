"""Effect of tolerances on readings: distributions, samples, shares of the spread."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
