"""Surrogate models of a sensor for simulators: readings as polynomials of the varied parameters, as ONNX files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
