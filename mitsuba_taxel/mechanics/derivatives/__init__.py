"""Derivatives of equilibria with respect to load, material and shape.

Input: a :class:`~mitsuba_taxel.mechanics.continuation.state.State`. Output: rates of its displacement, gradients of
scalars that depend on the displacement, and the change of the stiffness of its softest mode.
"""
