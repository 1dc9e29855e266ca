"""Design optimisation within bounds and constraints, with gradients of the whole chain.

Input: a study file with variables, bounds, a figure of merit and constraints. Output: the best design with multipliers,
slopes and an estimate of its error, and drawings of its pad.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
