"""Intervals of figures that need no pad, counted on made-up truth.

Synthetic records, fits, tolerances and comparisons enter; how often stated intervals and probabilities came true
leaves.
"""
