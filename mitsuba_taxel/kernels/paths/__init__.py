"""Paths of light: sampling of directions, guiding to small detectors, tracing, and recorded kernels."""
