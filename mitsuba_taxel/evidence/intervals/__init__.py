"""Coverage of stated errors, intervals and probabilities on synthetic data, whose true values are known; no pad is
solved.

Input: synthetic recordings, fits, tolerance studies and comparisons. Output: the fraction of true values within the
stated intervals, and observed frequencies of events with stated probabilities.
"""
