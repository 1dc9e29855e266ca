"""Derivatives of equilibria with respect to load, material and shape.

Enters: a :class:`~mitsuba_taxel.mechanics.continuation.state.State`. Leaves: rates of its displacement, gradients of
scalars of it, and how its least stiff mode changes.
"""
