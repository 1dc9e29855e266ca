"""Parameters of the integrator that starts at the phototransistors."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.specification.path_depth import PathDepth


@dataclass(frozen=True)
class TaxelPath(PathDepth):
    """Integrator whose light paths start at the phototransistors."""

    plugin = "taxel_path"
