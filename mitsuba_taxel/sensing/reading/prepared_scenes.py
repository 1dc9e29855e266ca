"""What is known of a scene before light is traced: the errors of its shape, the mesh and the points that it needs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.sensing.reading.readings import largest_share
from mitsuba_taxel.sensing.reading.runs import AnyScene, Prepared, Run
from mitsuba_taxel.sensing.scene.description import Scene

LIGHT_SHARE = 0.5
"""Share of the light in a target error that the mechanics does not reach."""
EXACT_SHARE = 0.75
"""Largest share of light without random numbers, which no points make smaller, in a target: finer elements, which leave
two thirds of it to the mechanics, take less time than paths."""


class Settings(NamedTuple):
    """Settings of a reading: points per taxel and replicate, 0 if it needs no random numbers; mesh size of pads in mm,
    None for the scene's own."""

    points: int
    mesh_size: float | None


class MechanicsEstimate(NamedTuple):
    """Error of readings by that of the mechanics.

    Attributes
    ----------
    deviation : (T,) ndarray or None
        In W, as in `Readings`; None if no pad is loaded.
    share : float
        Corresponding relative error; NaN if unknown.
    """

    deviation: np.ndarray | None
    share: float


class FacetsEstimate(NamedTuple):
    """Error of readings by the flat triangles of curved walls.

    Attributes
    ----------
    facets : (T,) ndarray or None
        In W, as in `Readings`; None if no wall is curved.
    share : float
        Corresponding relative error.
    pilot : Run or None
        The first run of :func:`points_for`, if it exists already.
    """

    facets: np.ndarray | None
    share: float
    pilot: Run | None


FLAT = FacetsEstimate(None, 0.0, None)


class ShapeErrors(NamedTuple):
    """The errors of a scene's shape, and the power of each taxel in W where it is known without random numbers."""

    mechanics: MechanicsEstimate
    geometry: FacetsEstimate
    power: np.ndarray | None = None

    @property
    def share(self) -> float:
        """Relative error of all readings together, or of the worst one where light has no noise: then it is all."""
        return math.hypot(self.mechanics.share, self.light_share)

    @property
    def known_share(self) -> float:
        """The same without that of the mechanics where that is unknown."""
        return self.light_share if math.isnan(self.mechanics.share) else self.share

    @property
    def light_share(self) -> float:
        """Relative error by the geometry, with all errors of the light of the worst reading where it has no noise."""
        if self.power is None or self.geometry.facets is None:
            return self.geometry.share
        return FACETS_SHARE * largest_share(np.abs(self.geometry.facets), self.power)

    def suffices(self, target_error: float) -> bool:
        """Whether light without random numbers reaches a target, with these elements or with finer ones."""
        return self.share <= target_error or self.light_share <= EXACT_SHARE * target_error


class PreparedFor(NamedTuple):
    """A scene prepared for a target error.

    Attributes
    ----------
    ready : Prepared
    errors : ShapeErrors
        Those of its shape, and its power if it needs no random paths.
    settings : Settings
    light_error : float
        Relative standard error that random paths should reach.
    alternative : PreparedFor or None
        The same without random numbers, whose error is above the target, but may be less than that of paths.
    """

    ready: Prepared
    errors: ShapeErrors
    settings: Settings
    light_error: float = math.inf
    alternative: PreparedFor | None = None


def mesh_size_of(scene: AnyScene) -> float | None:
    """Size in mm of the elements that were chosen for a scene; None for its own."""
    return scene.mesh_size if isinstance(scene, Scene) else None


def prepared_without_random_numbers(ready: Prepared, scene: AnyScene, errors: ShapeErrors) -> PreparedFor:
    """A scene whose light is known."""
    return PreparedFor(ready, errors, Settings(0, mesh_size_of(scene)))
