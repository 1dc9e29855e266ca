"""Comparison with other programs on the same cases.

Each peer is used where it is installed; ratios of times and differences of results leave (`taxel bench peers`).
"""
