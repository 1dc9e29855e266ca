"""Equilibria along a growing load: segments of load paths, step lengths, ends of paths, and buckling.

Input: a pad, a material, a load, the size of elements, and a value. Output: a
:class:`~mitsuba_taxel.mechanics.continuation.state.State`, bitwise independent of other requested states; or
:class:`~mitsuba_taxel.mechanics.continuation.load_path_ends.LoadPathEnds`.
"""
