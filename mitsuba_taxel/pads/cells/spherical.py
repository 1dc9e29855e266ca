"""Cells with the cap of a sphere."""

from mitsuba_taxel.pads.cells.cap import Cap
from mitsuba_taxel.pads.cells.cell_shape import LightSizes


class Spherical(Cap, name="spherical", rank=3):
    """A cylinder closed by the cap of a sphere of the radius `cell_size`.

    The cap is flatter than a dome: elements on it are smaller by a power of the share only. Those inside stay as large
    as they are on the default mesh, and are reached the faster, so that there are far fewer. Whether readings are
    accurate enough is shown by `taxel bench domes`, for other hemispheric mirrors too, which need small elements
    inside. Light leaves the cell after few reflections, of which each counts.
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
