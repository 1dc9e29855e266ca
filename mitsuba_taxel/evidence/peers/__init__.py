"""Comparison with other programs on the same cases.

Each peer is used where it is installed. Output: ratios of times and differences of results (`taxel bench peers`).
"""
