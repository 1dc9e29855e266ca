"""Equilibria along a growing load: segments of a path, the lengths of their steps, where they end, how they buckle.

Enters: a pad, a material, a load, the size of elements, and a value. Leaves: a
:class:`~mitsuba_taxel.mechanics.continuation.state.State`, bitwise the same whichever others are requested; or
:class:`~mitsuba_taxel.mechanics.continuation.load_path_ends.LoadPathEnds`.
"""
