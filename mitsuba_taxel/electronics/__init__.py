"""From optical power to volts and counts: phototransistor, load resistor, buffer, converter, and their noise.

Input: optical power in W and the parameters of a circuit. Output: volts and counts with their errors and noise;
nothing here knows Mitsuba.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
