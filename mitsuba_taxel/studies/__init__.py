"""Batches of scenes over varied parameters, and the store of their results.

Input: a scene and the values of its parameters, or a study file. Output: a folder with a dataset of readings and their
errors, tables, meshes and images, to which an interrupted run returns.
"""

import lazy_loader

# Loaded lazily: only sweeps need xarray.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
