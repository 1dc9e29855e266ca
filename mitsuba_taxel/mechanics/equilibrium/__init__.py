"""One equilibrium of a pad: Newton's method, the nodes in contact, and whether the state is stable.

Input: a mesh, a material, a load and its value, and the unknowns at which the iteration starts. Output: displacements
and pressures in balance, and the factored tangent there; or
:class:`~mitsuba_taxel.mechanics.equilibrium.solution.Rejected`, with the reason.
"""
