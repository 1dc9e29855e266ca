"""Readings and derivatives of cells with domed, flat and rough roofs, compared with independent references.

Input: scenes of one cell. Output: tables with the stated and the true error of each (`taxel bench domes`, `horizon`,
`slopes`, `rough`).
"""
