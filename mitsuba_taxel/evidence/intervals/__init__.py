"""Coverage of intervals and probabilities on synthetic data with known truth, without a pad.

Input: synthetic records, fits, tolerances and comparisons. Output: the fractions of intervals and probabilities that
hold.
"""
