"""Batches of scenes over varied parameters, and the store of their results."""

import lazy_loader

# Loaded lazily: only sweeps need xarray.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
