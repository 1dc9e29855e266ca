"""Photo-reflectors from datasheets: bodies, windows, dies under clear resin, and the light received from a mirror."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
