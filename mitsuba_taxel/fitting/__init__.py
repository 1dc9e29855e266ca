"""Least squares with confidence intervals: unknowns of a scene from readings, and material laws from tests."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
