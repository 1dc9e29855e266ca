"""Readings of phototransistors: traced by random paths in increments, with errors by source, computing time and results
of pads.

Input: prepared scenes. Output: `Readings` with all known errors, and notes on errors that are unknown.
`sensing.targets` and `sensing.measurement` choose mesh, number of points and engine.
"""
