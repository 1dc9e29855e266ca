"""Readings and their slopes under domes, flat and rough roofs, compared with quadrature and with rays at a horizon.

Input: scenes of one cell whose light is known. Output: rows with stated and true error (`taxel bench domes`, `horizon`,
`slopes`, `rough`).
"""
