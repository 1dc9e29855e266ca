"""Parameters of walls by region."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import nested
from mitsuba_taxel.specification.specification import Specification
from mitsuba_taxel.specification.wall import Wall


def _wall(what: str) -> Wall | None:
    return nested("bsdf", Wall, None, f"BSDF of {what}.", by_name=True, default_words="absorbing")


@dataclass(frozen=True)
class Region(Specification):
    """Separate wall (BSDF) for each region of a pad or a photo-reflector."""

    plugin = "region"

    roof: Wall | None = _wall("the roofs of the pad's cells")
    side: Wall | None = _wall("the sides of the pad's cells or, beside coat or window, of a pad without cells")
    bottom: Wall | None = _wall("the bottom of the pad")
    top: Wall | None = _wall("the top of the pad")
    outer: Wall | None = _wall("the outside of the pad")
    coat: Wall | None = _wall("the top of a pad without cells, which a camera sees from inside")
    window: Wall | None = _wall("the bottom of a pad without cells, glued to a clear plate")
    body: Wall | None = _wall("the package of a photo-reflector")
    led: Wall | None = _wall("the face of the LED in a photo-reflector")
    phototransistor: Wall | None = _wall("the face of the phototransistor in a photo-reflector")
