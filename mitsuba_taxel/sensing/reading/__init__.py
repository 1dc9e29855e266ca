"""Readings and their components: random paths in increments, errors by source, cost, further results.

Input: prepared scenes. Output: `Readings`, with all known errors, and notes on unknown errors. `sensing.targets` and
`sensing.measurement` choose mesh, number of points and engine.
"""
