"""From optical power to volts and counts: phototransistor, load resistor, buffer, converter, and their noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
