"""Equilibrium along a load path, its stability and its derivatives."""
