"""Sections of the page of measured sensors, a file each: comparisons enter, Markdown leaves."""
