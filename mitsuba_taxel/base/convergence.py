"""Error of the finite elements, estimated from solutions on two meshes (L. F. Richardson, 1911).

If elements of size h cause the error e(h) = c h^p, the solutions on elements of the sizes r h and h differ by (r^p - 1)
e(h).
"""

COARSENING = 2.0
"""Requested element size of the second mesh, relative to the first mesh. The actual ratio is measured."""
ORDER = 1.5
"""Order p for averages over roofs, and therefore for errors of readings, from runs on finer meshes of all shapes."""
LOCAL_ORDER = 1.0
"""Order p of the largest local error, at edges where the stress is singular, and of gradients (G. Strang and G. J. Fix,
An Analysis of the Finite Element Method, 1973, chapter 8)."""
TYPICAL_ERROR = 0.01
"""Relative error of the roofs' displacement on elements of the default size: the median over shapes, walls and loads.
Four in five of these errors are between 0.006 and 0.023."""
SLOPE_ORDER = 2.0
"""Order p for derivatives of readings, chosen on four shapes of a single cell with elements of 0.4 to 2.5 mm. With the
order of averages, the errors of half of the slopes of nine taxels would be less than a third of the stated errors."""
TYPICAL_SLOPE_ERROR = 0.015
"""Least relative error of a derivative due to the displacement on elements of the default size, chosen on the same
cases."""

ERROR_SHARE = 1 / (COARSENING**ORDER - 1)
"""Error of an average, relative to its change on elements of twice the size."""
FACETS_SHARE = 0.2
"""Error of a reading due to the triangles of curved walls, relative to its change if the triangles are inscribed
instead of matching the walls on average. Compared with exact spheres, the ratio is 0.05 to 0.11 for diffuse walls, and
up to 0.4 for mirrors of few triangles."""
