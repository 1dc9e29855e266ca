"""Derivatives of equilibria with respect to load, material and shape.

Input: a :class:`~mitsuba_taxel.mechanics.continuation.state.State`. Output: rates of its displacement, gradients of
scalars of it, and how its least stiff mode changes.
"""
