"""Least squares with confidence intervals: unknowns of a scene from readings, and material laws from tests.

Input: measured readings or stress curves, and the unknowns with their start values and bounds. Output: the values of
the unknowns with confidence intervals, and files that scenes can use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
