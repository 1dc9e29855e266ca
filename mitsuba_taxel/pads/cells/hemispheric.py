"""Hemispheric cells."""

from mitsuba_taxel.pads.cells.cap import Cap
from mitsuba_taxel.pads.cells.cell_shape import LightSizes


class Hemispheric(Cap, name="hemispheric", rank=4):
    """A cell in the shape of a cylinder with a hemispheric roof, which joins the side smoothly."""

    default_height_words = "0.5 + cell_size / 2"
    has_sharp_rim = False
    has_curved_rim = True
    face_refinement = 2.25
    light_sizes = LightSizes(diffuse=0.6, mirrors=0.5, mirrors_side_by_side=0.55)

    @property
    def default_height(self) -> float:
        return 0.5 + 0.5 * self.pad.cell_size

    @property
    def roof_radius(self) -> float:
        return self.radius
