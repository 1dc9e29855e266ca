"""Measured sensors beside simulated ones: a pad of 5 x 5 cells on the bench, and the paper's loading cycles.

Public records and studies enter; comparisons, fits of memory and the figures of the page leave.
"""
