"""Cells whose roof is a spline, given by control points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads.cells.cell_shape import LightSizes
from mitsuba_taxel.pads.cells.meridian import SAMPLES, Meridian, control_points, roof_meridian
from mitsuba_taxel.pads.cells.meridian_cell import MeridianCell

MOST_POINTS = 20


class Profile(MeridianCell, name="profile", rank=5):
    """A cell with any smooth roof, given by the control points of its meridian, with a round or square section."""

    uses = ("profile", "section")
    default_height_words = "1.55"
    face_refinement = 2.25
    least_elements = 400
    has_curved_rim = True
    light_sizes = LightSizes(diffuse=0.5, mirrors=0.5, mirrors_side_by_side=0.5)

    @property
    def default_height(self) -> float:
        return 1.55

    @property
    def text(self) -> str:
        """The control points as text, as in the parameter `profile`."""
        assert self.pad.profile is not None
        return self.pad.profile

    @property
    def is_square(self) -> bool:
        return self.pad.section == "square"

    @property
    def top(self) -> float:
        return self.cell_height * highest(self.text)

    @property
    def side_height(self) -> float:
        return self.cell_height * float(control_points(self.text)[0, 1])

    @property
    def roof(self) -> Meridian:
        return roof_meridian(self.text, self.radius, self.cell_height)

    @property
    def dimensions(self) -> Mapping[str, float]:
        """The coordinates r and z of each control point as dimensions of the pad, such as ``profile_r1``; the crown
        (highest point) lies on the axis and has z only.
        """
        points = control_points(self.text).tolist()
        values: dict[str, float] = {}
        for number, (r, z) in enumerate(points, start=1):
            values |= {f"profile_r{number}": r, f"profile_z{number}": z}
        values.pop(f"profile_r{len(points)}")
        return values

    def parameters_at(self, dimensions: Mapping[str, float]) -> dict[str, Any]:
        *coordinates, crown = dimensions.values()
        return {"profile": [*zip(coordinates[::2], coordinates[1::2], strict=True), (0.0, crown)]}

    def check(self) -> None:
        """Refuse a profile that is out of range, or whose meridian turns back. Raises `InputError`."""
        points = control_points(self.text)
        r, z = points.T
        if not 2 <= len(points) <= MOST_POINTS:
            raise _refused(self.text, f"2 to {MOST_POINTS} points 'r z', separated by ';', are needed")
        if not (r[-1] == 0 and np.all((r[:-1] > 0) & (r[:-1] <= 1)) and np.all((z > 0) & (z <= 1))):
            needed = "r above 0 and up to 1, 0 for the last point alone, and z above 0 and up to 1 are needed"
            raise _refused(self.text, needed)
        position, tangent, _ = roof_meridian(self.text, 1.0, 1.0).at(np.linspace(0, 1, SAMPLES)[1:])
        if np.any(tangent[:, 0] * position[:, 1] - tangent[:, 1] * position[:, 0] <= 0):
            raise _refused(self.text, "every point of the roof must be seen from the middle of the cell's opening")

    def check_side(self, least: float) -> None:
        if self.side_height < least:
            raise _refused(self.text, f"z of the first point must be at least {least / self.cell_height:.3g}")


@kept(64)
def highest(text: str) -> float:
    """Height of the highest point of a profile, relative to the height of the cell."""
    heights = roof_meridian(text, 1.0, 1.0).height
    extrema = heights.derivative().roots(extrapolate=False)
    return float(heights(np.array([0.0, 1.0, *extrema[np.isfinite(extrema)]])).max())


def _refused(text: str, needed: str) -> InputError:
    return InputError(f"profile = {text!r} is not allowed: {needed}.")
