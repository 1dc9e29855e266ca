"""Cells with a spherical cap."""

from mitsuba_taxel.pads.cells.cap import Cap
from mitsuba_taxel.pads.cells.cell_shape import LightSizes


class Spherical(Cap, name="spherical", rank=3):
    """A cell in the shape of a cylinder, closed by the cap of a sphere of radius `cell_size`.

    The cap is flatter than a hemisphere. On meshes finer than the default, its elements are therefore refined less:
    their size is the mesh size times (mesh size / default)^0.7, with the exponent 1 for a hemisphere. Elements inside
    the silicone keep their default size, and the size grows faster from the wall inwards, which leaves far fewer
    elements. `taxel bench domes` shows that readings are accurate enough with them. Light leaves this cell after few
    reflections, each of which counts; hemispheric mirrors, in which it is reflected more often, need small elements
    inside as well.
    """

    default_height_words = "1.6"
    finer_power = 0.7
    finer_inside = True
    light_sizes = LightSizes(diffuse=0.5, mirrors=0.6, mirrors_side_by_side=0.6)

    @property
    def default_height(self) -> float:
        return 1.6

    @property
    def roof_radius(self) -> float:
        return self.pad.cell_size
