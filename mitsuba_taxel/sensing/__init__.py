"""Scenes, their parts as Python objects, and readings with their error.

Input: a scene as XML, as Python objects, or as a dictionary of Mitsuba. Output: readings in W with their errors and
derivatives, images of cameras, audits of light paths, or a refusal in one line.
"""

import lazy_loader

# Plugins import modules of this package individually, before any variant is set.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
