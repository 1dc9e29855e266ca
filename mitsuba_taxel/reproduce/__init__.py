"""Rerun of the paper: its figures and tables from this package, compared with the paper's own numbers."""
