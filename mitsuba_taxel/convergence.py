"""How the error of the finite elements is told from solutions on two meshes."""

COARSENING = 2.0
"""Element size of the second mesh, relative to that of the first."""
ORDER = 1.5
"""With which averages over roofs fall with the elements' size, and so the errors of readings do, from runs on finer
meshes of all shapes: more than 1, with which the worst place does."""
