"""Fast models of a sensor: readings from forces or from maps of contact depth, and forces from readings.

Input: a study, or solved contacts of a pad without cells. Output: models that run without Mitsuba, as ONNX, NumPy or
Python files, with their ranges, errors and flags.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
