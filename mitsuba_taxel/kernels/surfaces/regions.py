"""Names of the regions of a surface, and their codes in the face attribute ``face_region`` of its mesh."""

from __future__ import annotations

from mitsuba_taxel.pads import REGIONS

BODY_REGIONS = {"body": 6, "led": 7, "phototransistor": 8}
"""Codes of the regions of a photo-reflector's surface."""

CONTACT = 0
"""Code of the walls of a pad that touch a package: no light passes between, and a `region` absorbs there."""

ALL_REGIONS = {**REGIONS, **BODY_REGIONS}
"""Codes of all regions of the meshes of this package."""

COAT_REGIONS = {"coat": "top", "window": "bottom", "side": "outer"}
"""Names of the regions of a pad without cells, behind which a camera sits, and the regions that they are. A `region`
with a coat or a window uses these names."""
