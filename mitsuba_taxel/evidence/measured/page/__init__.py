"""Sections of the page of measured sensors, a file each. Input: comparisons. Output: Markdown."""
