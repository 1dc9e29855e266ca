"""Comparison with other programs on the same cases."""
