"""Components of the plugins: emission, scattering, faces, path sampling.

Inputs are arrays of Dr.Jit and parameters of plugins; outputs are samples, densities and weights. The interfaces of the
plugins are in `protocols`. Nothing in this package depends on how a scene was described.
"""
