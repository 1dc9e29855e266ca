"""Figures of curves and of figures of merit."""
