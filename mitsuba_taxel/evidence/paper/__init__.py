"""Rerun of the paper: its figures and tables are computed with this package and compared with the published numbers.

Input: a scene, whose parameters include the choices that the paper leaves open. Output: studies, figures and the page.
"""
