"""Figures of curves and of figures of merit.

Input: studies and tables of results. Output: figures as PNG and SVG files, and a film as an animated PNG.
"""
