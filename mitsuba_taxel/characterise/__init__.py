"""Figures of merit of a sensor from its readings against force, simulated or measured.

Input: studies of simulated readings, or tables of a test bench. Output: tables of sensitivity, nonlinearity, hysteresis
and repeatability, each with its error.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
