"""Rerun of the paper: its figures and tables from this package, compared with its own numbers.

Input: the choices that the paper leaves open, as parameters of a scene. Output: studies, figures and the page.
"""
