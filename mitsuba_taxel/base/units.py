"""Units of the quantities in a study."""

from __future__ import annotations

FORCES = ("fx", "fy", "fz")

PARAMETER_UNITS = {
    **dict.fromkeys(FORCES, "N"),
    "youngs_modulus": "MPa",
    "poisson_ratio": "1",
    **dict.fromkeys(("spacing", "hole", "z", "width", "depth", "offset_x", "offset_y"), "mm"),
    **dict.fromkeys(("pitch", "wall", "height", "cell_size", "mesh_size", "led_size"), "mm"),
    "power": "W",
    "wavelength": "nm",
}
"""Units of the shipped scenes' numeric parameters; the unit of any other parameter is not known."""
