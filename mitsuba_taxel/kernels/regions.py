"""Names of the regions of a surface, and their codes in the face attribute ``face_region`` of its mesh."""

from __future__ import annotations

from mitsuba_taxel.pads import REGIONS

BODY_REGIONS = {"body": 6, "led": 7, "phototransistor": 8}
"""Codes of the regions of a photo-reflector's surface."""

ALL_REGIONS = {**REGIONS, **BODY_REGIONS}
"""Codes of all regions that our meshes may have."""
