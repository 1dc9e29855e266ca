"""Measured sensors compared with simulated ones: a pad of 5 x 5 cells on the bench, and the paper's loading cycles.
Input: public records and studies. Output: comparisons, fits of Prony series and the figures of the page.
"""
