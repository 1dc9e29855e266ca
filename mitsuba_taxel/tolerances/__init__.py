"""Effect of tolerances on readings: distributions, samples, shares of the spread.

Input: a scene and distributions of its parameters. Output: spreads of the figures of merit, and the shares of the
parameters in them, each with its error.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
