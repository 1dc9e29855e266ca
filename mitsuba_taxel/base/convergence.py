"""How the error of the finite elements is told from solutions on two meshes (L. F. Richardson, 1911).

If the error goes with the p-th power of the elements' size h, e(h) = c h^p, then the difference of solutions on
elements of r h and of h is (r^p - 1) e(h).
"""

COARSENING = 2.0
"""Element size of the second mesh that is asked for, relative to that of the first. What it is in fact is measured."""
ORDER = 1.5
"""With which averages over roofs fall with the elements' size, and so the errors of readings do, from runs on finer
meshes of all shapes."""
LOCAL_ORDER = 1.0
"""With which the worst place does, at edges where the stress is singular, and gradients do (G. Strang and G. J. Fix, An
Analysis of the Finite Element Method, 1973, chapter 8)."""
TYPICAL_ERROR = 0.01
"""By which roofs move too little on elements of the default size, relative: the median over shapes, walls and loads,
with four in five between 0.006 and 0.023."""

ERROR_SHARE = 1 / (COARSENING**ORDER - 1)
"""Of what elements of twice the size would change in an average, that is the error on those of the size itself."""
FACETS_SHARE = 0.2
"""Of what a reading changes where the triangles of curved walls are chords instead of having the walls' mean, that is
the error that they leave: against spheres 0.05 to 0.11 for diffuse walls, up to 0.4 for mirrors of few triangles."""
