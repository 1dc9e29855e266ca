"""Scenes prepared for a reading, before light is traced: errors of the shape, and the mesh and the points needed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.sensing.reading.readings import largest_share
from mitsuba_taxel.sensing.reading.runs import AnyScene, Prepared, Run
from mitsuba_taxel.sensing.scene.description import Scene

LIGHT_SHARE = 0.5
"""Fraction of a target error for the light, where the mechanics does not reach the target."""
EXACT_SHARE = 0.75
"""Largest error of light without random numbers, relative to a target, with which elements are refined rather than
paths traced. No points reduce this error, but finer elements, with two thirds of the target for the mechanics, take
less time than paths."""


class Settings(NamedTuple):
    """Settings of a reading.

    Attributes
    ----------
    points : int
        Number of points per taxel and replicate; 0 without random numbers.
    mesh_size : float or None
        Mesh size of pads, in mm; None for the mesh size of the scene.
    """

    points: int
    mesh_size: float | None


class MechanicsEstimate(NamedTuple):
    """Error of readings due to the mechanics.

    Attributes
    ----------
    deviation : (T,) ndarray or None
        Change of the power in W, as in `Readings`; None if no pad is loaded.
    share : float
        The relative error; NaN if unknown.
    """

    deviation: np.ndarray | None
    share: float


class FacetsEstimate(NamedTuple):
    """Error of readings due to the flat triangles of curved walls and of random heights.

    Attributes
    ----------
    facets : (T,) ndarray or None
        Change of the power in W, as in `Readings`; None if there are no such walls.
    share : float
        Relative error of readings.
    pilot : Run or None
        A run that :func:`points_for` continues, if any.
    heights : float
        Part of ``share`` due to random heights, which smaller elements do not change.
    """

    facets: np.ndarray | None
    share: float
    pilot: Run | None
    heights: float = 0.0


FLAT = FacetsEstimate(None, 0.0, None)


class ShapeErrors(NamedTuple):
    """Errors due to the shape of a scene.

    Attributes
    ----------
    mechanics : MechanicsEstimate
        Error due to the finite elements.
    geometry : FacetsEstimate
        Error due to the triangles of curved walls; without random numbers, by the discretisation of the light.
    power : (T,) ndarray or None
        Readings in W, if computed without random numbers.
    """

    mechanics: MechanicsEstimate
    geometry: FacetsEstimate
    power: np.ndarray | None = None

    @property
    def share(self) -> float:
        """Relative error of all readings together; without random numbers, the total error of the worst reading."""
        return math.hypot(self.mechanics.share, self.light_share)

    @property
    def refinable_share(self) -> float:
        """Part of ``share`` that decreases with the size of the elements."""
        return math.sqrt(max(self.share**2 - self.geometry.heights**2, 0.0))

    @property
    def known_share(self) -> float:
        """Relative error, without the mechanics if that is unknown."""
        return self.light_share if math.isnan(self.mechanics.share) else self.share

    @property
    def light_share(self) -> float:
        """Relative error due to the geometry; without random numbers, the error of the light of the worst reading."""
        if self.power is None or self.geometry.facets is None:
            return self.geometry.share
        return FACETS_SHARE * largest_share(np.abs(self.geometry.facets), self.power)

    def suffices(self, target_error: float) -> bool:
        """Whether light without random numbers reaches a relative target, with these elements or with finer ones."""
        return self.share <= target_error or self.light_share <= EXACT_SHARE * target_error


class PreparedFor(NamedTuple):
    """A scene prepared for a target error.

    Attributes
    ----------
    ready : Prepared
        The scene.
    errors : ShapeErrors
        Errors due to the shape of the scene, and the readings if no random paths are needed.
    settings : Settings
        Settings of the reading.
    light_error : float
        Relative standard error that random paths should reach.
    alternative : PreparedFor or None
        The scene without random paths, with an error above the target that may still be less than that of paths.
    """

    ready: Prepared
    errors: ShapeErrors
    settings: Settings
    light_error: float = math.inf
    alternative: PreparedFor | None = None


def mesh_size_of(scene: AnyScene) -> float | None:
    """Size in mm of the elements that were chosen for a scene; None for the default."""
    return scene.mesh_size if isinstance(scene, Scene) else None


def prepared_without_random_numbers(ready: Prepared, scene: AnyScene, errors: ShapeErrors) -> PreparedFor:
    """A scene whose readings were computed without random numbers.

    Parameters
    ----------
    ready : Prepared
        The scene, loaded.
    scene : AnyScene
        The scene as described.
    errors : ShapeErrors
        Errors with the readings.

    Returns
    -------
    PreparedFor
        Prepared scene without points.
    """
    return PreparedFor(ready, errors, Settings(0, mesh_size_of(scene)))
