"""Surfaces of pads and walls: scattering laws, regions, meshes."""
