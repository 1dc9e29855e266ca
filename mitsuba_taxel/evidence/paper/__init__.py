"""Rerun of the paper: its figures and tables from this package, compared with its own numbers.

The choices that the paper leaves open enter as parameters of a scene; studies, figures and the page leave.
"""
