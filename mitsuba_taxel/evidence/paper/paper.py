"""Numbers published in the paper: Cirillo et al., Multiphysics Simulation for the Optimization of an
Optoelectronic-Based Tactile Sensor. Forces are in N, lengths in mm, sensitivities in W/N (simulated) or V/N
(measured)."""

from __future__ import annotations

CELLS = ("parallelepiped", "cylindrical", "spherical", "hemispheric")
"""The four shapes, in the order of Table 1."""

NORMAL = {"parallelepiped": 1.48e-4, "cylindrical": 1.11e-4, "spherical": 1.4e-4, "hemispheric": 2.48e-4}
TANGENTIAL = {"parallelepiped": 2.48e-4, "cylindrical": 1.87e-4, "spherical": 2.66e-4, "hemispheric": 3.91e-4}
"""Table 1: maximum slope of all curves, in W/N, under normal and under tangential forces."""

MEASURED_NORMAL = {
    "parallelepiped": (0.0196, 0.0355),
    "spherical": (0.00467, 0.00716),
    "hemispheric": (0.00335, 0.00869),
}
"""Table 2: the least and the most sensitive taxel."""
MEASURED_TANGENTIAL = {
    "parallelepiped": (0.0342, 0.0314),
    "spherical": (0.00271, 0.00276),
    "hemispheric": (0.00668, 0.00569),
}
"""Table 3: along x and y."""
MEASURED_NONLINEARITY = {"parallelepiped": 3.18, "spherical": 5.38, "hemispheric": 11.7}
"""Table 4, in percent."""
MEASURED_FORCE = 10.0
"""Largest normal force of the experiments (section 3.1)."""

NORMAL_FORCE = 20.0
FORCE_STEP = 0.5
CONSTANT_NORMAL_FORCE = 8.0
"""Magnitude of the normal force under which tangential forces act (section 2.3)."""
TANGENTIAL_LIMIT = {"parallelepiped": 11.0, "cylindrical": 13.0, "spherical": 8.0, "hemispheric": 13.0}
"""Force at which the paper's solver stopped."""
SHOWN_TANGENTIAL_FORCE = 8.0
"""Resultant along the secondary diagonal in Fig. 10."""

RAYS = 20 * 3000
"""Rays of each LED: 20 release points with 3000 rays each (section 2.1.3)."""

PEAK_HEIGHT = 0.30
"""Plate height at the peak of the datasheet's curve (section 2.1.1)."""
LARGEST_HEIGHT = 2.5
HEIGHT_STEP = 0.02
EDGE_HEIGHT = 0.7
LARGEST_EDGE_DISTANCE = 1.5
