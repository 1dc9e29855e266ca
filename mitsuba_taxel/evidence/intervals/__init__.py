"""Coverage of intervals and probabilities on synthetic data with known truth, without a pad.

Synthetic records, fits, tolerances and comparisons enter; the fractions of intervals and probabilities that hold leave.
"""
