"""Comparison of this package with other programs (peers) on the same cases.

A peer is used if it is installed. Output: tables with times and differences of results (`taxel bench peers`).
"""
