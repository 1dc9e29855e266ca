"""Equilibria along a growing load: segments of load paths, step lengths, ends of paths, and buckling.

Enters: a pad, a material, a load, the size of elements, and a value. Leaves: a
:class:`~mitsuba_taxel.mechanics.continuation.state.State`, bitwise the same whichever others are requested; or
:class:`~mitsuba_taxel.mechanics.continuation.load_path_ends.LoadPathEnds`.
"""
