"""Photo-reflectors from datasheets: bodies, windows, dies under clear resin, and the light received from a mirror.

Input: the name of a part, or a file with numbers of its datasheet. Output: the bodies of LED and phototransistor with
their emission and response, and their reading above a mirror.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
