"""Points, triangles, curved patches and volume meshes, and what can be computed of them alone."""
