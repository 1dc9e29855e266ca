"""Checks of scenes before rendering: names, units, positions and light.

Input: a scene file and values of its parameters, or an installation. Output: findings, each with a severity, a place
and a remedy, and the schema of scenes.
"""

import lazy_loader

# The schema needs only the plugins' tables, and no variant.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
