"""Comparison of measured sensors with simulations: a measured pad of 5 x 5 cells, and the loading cycles of the paper.
Input: public measurements, and studies of scenes. Output: comparisons, fitted Prony series, and the page
`validation.md` with its figures.
"""
